"""Judges `ik_sink` beside the differential inverse kinematics of pink and of Drake, on the same cases.

CONTRIBUTING.md says how to run it. A third of the postures are near a singularity or have joints at a limit, and a
third of the twists are slides in the plane of the pad. The velocity of each solver is judged by the Jacobian of
Pinocchio, in the frame of the sensor. Angles between twists count 1 rad as 0.2 m.

Every solver gets the same home posture, the same gain toward it (0.5/s), and the limits of the model:

- pink minimizes the error of the twist and, with a small weight, that of the posture, within its limits of range and
  speed, with its own damping.
- pink, ruled is pink with the two further rules of `ik_sink`: room to brake, and no push beyond the one that is asked.
- Drake maximizes the part of the twist that it keeps, with exactly its direction, and centres the joints.

The metrics, of which a lower value is better:

- limits: cases in which a joint exceeds its speed, or leaves its range within a step of 20 ms, also in the motions.
- braking: cases in which a joint is so fast toward its limit that it cannot stop before it, with its acceleration.
- turn: the angle between the motion of the sensor and the twist [deg]. A motion below 1 % of the twist has none, it
  counts as stopped.
- push: speed along z of the sensor that a slide gets, as a fraction of the speed of the slide.
- stuck: motions of 0.5 s with the twist held after which the arm follows less than a tenth of the twist.
- lost: mean length of the part of the twist that is not made, as a fraction of the twist.
- slowed: mean fraction of the twist that is missing along its direction.
- jump: change of the velocities between two postures that are 1e-4 rad apart [rad/s].
- posture: distance of the motion of the elbow from the one toward home, as a fraction of the latter; arms with an
  elbow, ordinary postures in which the twist and the posture can both be had within the speeds and braking distances.
"""

import argparse
import logging
import sys
import time
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
import pinocchio as pin
import pink
from pink.limits import ConfigurationLimit, Limit, VelocityLimit
from pink.tasks import PostureTask
from pink.tasks.task import Task
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DoDifferentialInverseKinematics,
)

ROBOTS = Path(__file__).resolve().parents[2] / "graphs" / "robots"
TIPS = {"lwr4p": "lwr_7_link", "panda": "panda_link8", "ur5e": "tool0"}
HOMES = {
    "lwr4p": [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0],
    "panda": [0.0, -0.1, 0.0, -2.2, 0.0, 2.1, np.pi / 4],
    "ur5e": [0.0, -1.7, -2.0, -1.0124, np.pi / 2, 0.0],
}
ACCELERATIONS = {"lwr4p": 10.0, "panda": 7.5, "ur5e": 10.0}  # [rad/s2]
POSTURE_GAIN = 0.5  # [1/s]
BRAKING_DELAY = 0.2  # [s], of `ik_sink`
WEIGHT = np.array([1.0, 1.0, 1.0, 0.2, 0.2, 0.2])  # [1, m]
KINDS = ("ordinary", "limit", "singular")


class TwistTask(Task):
    """The task of pink that a frame moves with a twist in its own frame."""

    def __init__(self, frame, dt):
        super().__init__(cost=WEIGHT, gain=1.0, lm_damping=0.0)
        self.frame, self.dt, self.twist = frame, dt, np.zeros(6)

    def __repr__(self):
        return f"TwistTask({self.frame!r}, {self.dt})"

    def compute_error(self, configuration):
        return -self.dt * self.twist

    def compute_jacobian(self, configuration):
        return configuration.get_frame_jacobian(self.frame)


class Rules(Limit):
    """The rules of `ik_sink` as a limit of pink: room to brake, and a motion along z between 0 and the wanted one."""

    def __init__(self, robot):
        super().__init__()
        self.robot = robot

    def compute_qp_inequalities(self, configuration, dt):
        robot, q = self.robot, configuration.q
        eye = np.eye(len(q))
        push, wanted = robot.jacobian(q)[2], robot.task.twist[2]
        rooms = (robot.upper - q, q - robot.lower)
        fastest = [np.minimum(robot.fastest(room, BRAKING_DELAY), robot.speed) for room in rooms]
        return np.vstack([eye, -eye, push, -push]), dt * np.hstack([*fastest, max(wanted, 0), max(-wanted, 0)])


class Robot:
    def __init__(self, name, dt):
        self.model = pin.buildModelFromUrdf(str(ROBOTS / f"{name}.urdf"))
        self.data = self.model.createData()
        self.tip = TIPS[name]
        self.frame = self.model.getFrameId(self.tip)
        self.dt = dt
        self.home = np.array(HOMES[name])
        self.lower, self.upper = self.model.lowerPositionLimit, self.model.upperPositionLimit
        self.speed = self.model.velocityLimit
        self.acceleration = ACCELERATIONS[name]
        self.task = TwistTask(self.tip, dt)
        self.posture = PostureTask(cost=1e-3, gain=POSTURE_GAIN * dt)
        self.posture.set_target(self.home)
        self.limits = [ConfigurationLimit(self.model), VelocityLimit(self.model)]
        self.ruled = [*self.limits, Rules(self)]
        count = self.model.nq
        self.drake = DifferentialInverseKinematicsParameters(count, count)
        self.drake.set_time_step(dt)
        self.drake.set_nominal_joint_position(self.home)
        self.drake.set_joint_centering_gain(POSTURE_GAIN * np.eye(count))
        self.drake.set_joint_position_limits((self.lower, self.upper))
        self.drake.set_joint_velocity_limits((-self.speed, self.speed))

    def jacobian(self, q):
        return pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL)

    def fastest(self, room, delay):
        """The speeds from which the joints stop within their room, after a delay."""
        return self.acceleration * (np.sqrt(delay**2 + 2 * room.clip(0) / self.acceleration) - delay)

    def by_pink(self, q, twist, limits=None):
        configuration = pink.Configuration(self.model, self.data, q)
        self.task.twist = twist
        tasks = [self.task, self.posture]
        try:
            return pink.solve_ik(
                configuration, tasks, self.dt, "quadprog", limits=limits or self.limits, safety_break=False
            )
        except (pink.exceptions.PinkError, ValueError):
            return None

    def by_ruled_pink(self, q, twist):
        return self.by_pink(q, twist, self.ruled)

    def by_drake(self, q, twist):
        result = DoDifferentialInverseKinematics(q, np.zeros_like(q), twist, self.jacobian(q), self.drake)
        if result.status == DifferentialInverseKinematicsStatus.kNoSolutionFound:
            return None
        return result.joint_velocities


class Metrics:
    """What is counted for one solver."""

    def __init__(self):
        self.values = defaultdict(list)

    def add(self, name, kind, value):
        self.values[name, kind].append(float(value))

    def judge(self, robot, kind, q, twist, v, near_v, path):
        """Judges the velocity `v`, that of the neighbour, and the postures of the motion that follows."""
        if v is None:
            self.add("failed", kind, 1)
            v = np.zeros_like(q)
        else:
            self.add("failed", kind, 0)
        j = robot.jacobian(q)
        achieved, asked = WEIGHT * (j @ v), WEIGHT * twist
        size = np.linalg.norm(asked)
        self.add("limits", kind, violates(robot, q, v) or any(violates(robot, *at) for at in steps(robot, q, path)))
        self.add("braking", kind, overruns(robot, q, v))
        along = achieved @ asked / size**2
        self.add("slowed", kind, 1 - along)
        self.add("lost", kind, np.linalg.norm(achieved - asked) / size)
        moved = np.linalg.norm(achieved)
        if moved > 0.01 * size:
            # The arc tangent is exact for small angles.
            across = np.linalg.norm(achieved - along * asked)
            self.add("turn", kind, np.degrees(np.arctan2(across, along * size)))
        if not twist[2:].any():
            self.add("push", kind, abs(j[2] @ v) / np.linalg.norm(twist))
        self.add("jump", kind, np.abs(v - (near_v if near_v is not None else 0)).max())
        if path is not None and len(path) > 1:
            last = WEIGHT * (robot.jacobian(path[-2]) @ ((path[-1] - path[-2]) / robot.dt))
            self.add("stuck", kind, last @ asked / size**2 < 0.1)
        if kind == "ordinary" and len(q) > 6:
            inverse = np.linalg.pinv(j)
            null = np.eye(len(q)) - inverse @ j
            wanted = null @ (POSTURE_GAIN * (robot.home - q))
            both = inverse @ twist + wanted
            if violates(robot, q, both) or overruns(robot, q, both, BRAKING_DELAY, -1e-6):
                return
            self.add("posture", kind, np.linalg.norm(null @ v - wanted) / max(np.linalg.norm(wanted), 1e-3))


def violates(robot, q, v):
    """Whether a velocity exceeds a speed, or a joint within its range leaves it in one step."""
    after = q + robot.dt * v
    inside = (q >= robot.lower - 1e-9) & (q <= robot.upper + 1e-9)
    outside = (after < robot.lower - 1e-6) | (after > robot.upper + 1e-6)
    return bool((np.abs(v) > robot.speed * (1 + 1e-6)).any() or (inside & outside).any())


def overruns(robot, q, v, delay=0.0, tolerance=1e-6):
    """Whether a joint that keeps its speed for the delay [s] cannot stop before its limit."""
    room = np.where(v > 0, robot.upper - q, q - robot.lower)
    return bool((np.abs(v) > robot.fastest(room, delay) + tolerance).any())


def steps(robot, q, path):
    for after in path if path is not None else ():
        yield q, (after - q) / robot.dt
        q = after


def motion(robot, solve, q, twist, count):
    """Returns the postures of a motion that holds the twist."""
    path = []
    for _ in range(count):
        v = solve(q, twist)
        q = q + robot.dt * v if v is not None else q
        path.append(q)
    return np.array(path)


def read(path, stride):
    """Yields the cases, and first the length of a step and the number of steps."""
    with open(path) as lines:
        head = next(lines).split()
        yield float(head[0]), int(head[1])
        for number, line in enumerate(lines):
            if number // 18 % stride:
                continue
            name, kind, count, *values = line.split()
            n, values = int(count), np.array(values, float)
            q, twist, v, near, near_v, path = np.split(values, np.cumsum([n, 6, n, n, n]))
            yield name, kind, q, twist, v, near, near_v, path.reshape(-1, n)


def judged(path, stride):
    cases = read(path, stride)
    dt, count = next(cases)
    robots = {name: Robot(name, dt) for name in TIPS}
    all_metrics = {name: Metrics() for name in ("ik_sink", "pink", "pink, ruled", "Drake")}
    began, number = time.monotonic(), 0
    for number, (name, kind, q, twist, v, near, near_v, ours) in enumerate(cases, 1):
        robot = robots[name]
        all_metrics["ik_sink"].judge(robot, kind, q, twist, v, near_v, ours if len(ours) else None)
        solvers = {"pink": robot.by_pink, "pink, ruled": robot.by_ruled_pink, "Drake": robot.by_drake}
        for solver, solve in solvers.items():
            path = motion(robot, solve, q, twist, count) if kind != "ordinary" else None
            all_metrics[solver].judge(robot, kind, q, twist, solve(q, twist), solve(near, twist), path)
    print(f"{number} cases, {time.monotonic() - began:.0f} s")
    return all_metrics


def percent(values):
    return f"{100 * np.mean(values):.2f} %"


def percentiles(values, unit=""):
    values = np.array(values)
    return " / ".join(f"{np.percentile(values, at):.2g}" for at in (50, 99, 100)) + unit


def table(all_metrics):
    rows = []
    for name, show in (
        ("failed", percent), ("limits", percent), ("braking", percent), ("turn", percentiles), ("push", percentiles),
        ("stuck", percent), ("lost", percent), ("slowed", percent), ("jump", percentiles), ("posture", percentiles),
    ):
        for kind in KINDS:
            cells = [metrics.values.get((name, kind)) for metrics in all_metrics.values()]
            if all(cells):
                rows.append([name, kind, *(show(cell) for cell in cells)])
    print("Three numbers are the median, the 99th percentile and the largest value.\n")
    print("| metric | postures | " + " | ".join(all_metrics) + " |")
    print("|---|---|" + "---|" * len(all_metrics))
    for row in rows:
        print("| " + " | ".join(row) + " |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", help="file that the test `arm::ik_sink::cases` writes")
    parser.add_argument("--stride", type=int, default=1, help="judge only each block of 18 cases out of so many")
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore")
    logging.disable(logging.WARNING)
    table(judged(arguments.cases, arguments.stride))


if __name__ == "__main__":
    sys.exit(main())
