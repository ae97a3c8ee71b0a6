#!/usr/bin/env python3
"""Reads the robot of `ur.py` with the client `ur_rtde` from the package index, which knows nothing of this project.

It starts the robot itself. Its exit code says whether the client reads what the robot was set to.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import rtde_receive

NAMES = ["timestamp", "actual_q", "target_q", "actual_qd", "actual_TCP_pose", "actual_TCP_force", "robot_mode",
         "safety_mode", "runtime_state", "speed_scaling", "target_speed_fraction", "payload"]
# The UR5e stretched along -x: the sums of the lengths in its maker's table.
POSE = [-0.8172, -0.2329, 0.0628, math.pi / 2, 0.0, 0.0]
FORCE = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]


def near(found, wanted):
    return len(found) == len(wanted) and all(abs(a - b) < 1e-6 for a, b in zip(found, wanted))


def main():
    settings = {"rtde_port": 30004, "q": [0.0] * 6, "force": FORCE, "slider": 0.8, "payload": 1.25, "texts": 5}
    command = [sys.executable, str(Path(__file__).with_name("ur.py")), json.dumps(settings)]
    robot = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        robot.stdout.readline()
        client = rtde_receive.RTDEReceiveInterface("127.0.0.1", 125.0, NAMES)
        checks = {
            "connected": client.isConnected(),
            "actual_q": near(client.getActualQ(), [0.0] * 6),
            "actual_TCP_pose": near(client.getActualTCPPose(), POSE),
            "actual_TCP_force": near(client.getActualTCPForce(), FORCE),
            "modes": (client.getRobotMode(), client.getSafetyMode(), client.getRuntimeState()) == (7, 1, 1),
            "slider": near([client.getTargetSpeedFraction(), client.getPayload()], [0.8, 1.25]),
        }
        client.disconnect()
    finally:
        robot.kill()
    wrong = [name for name, is_right in checks.items() if not is_right]
    print(f"ur_rtde reads {len(checks) - len(wrong)} of {len(checks)}" + (f", but not {wrong}" if wrong else ""))
    return 1 if wrong else 0


sys.exit(main())
