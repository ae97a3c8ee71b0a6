"""A robot of ROS 2 with a pad, over CycloneDDS: it plays the arm, its controller, the pad and a ball.

    python3 robot.py '{"domain": 7, "urdf": "graphs/robots/lwr4p.urdf"}'

The arm is stiff and follows its controller with a lag. The controller is that of `joint_trajectory_controller`, or
one that follows velocities and stops after 100 ms without one, or MoveIt Servo: it takes twists of the tip in the axes of
`base` [m/s, rad/s], makes joint velocities of them with the pseudoinverse, and stops when the stamp of the last twist is
100 ms old. A trajectory starts at its stamp. One that has ended
before it arrives is refused. The pad is an elastic foundation: each tactel is a spring that a ball at a fixed place
in the base presses. Friction, the weight of the arm and the flexibility of its joints are left out.

It prints a line of JSON every 20 ms: its wall clock, joints, their largest speed since the last line, the force, how
many commands it has taken and refused, and how old those since the last line were when they came. It reads words:
`quiet` and `talk` (the joint states), `blind` and `see` (the image), `second` (another publisher of commands), `twin`
(another publisher XX
"""

import json
import os
import sys
import threading
import time
import xml.etree.ElementTree

SETTINGS = {
    "domain": 0,
    "rate": 250.0,
    "command": "trajectory",
    # As they stand in the messages; None is the order of the model.
    "names": None,
    "stamp_offset": 0.0,
    "nan_at": None,
    "state_type": "JointState",
    "pad": "image",
    # The force [N] and the torque [N m] in the messages of the force sensor, or "nan"; None is the force on the pad.
    "wrench": None,
    "wrench_type": "WrenchStamped",
    "rows": 16,
    "start": [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0],
    "reader_durability": "volatile",
    "reader_type": None,
    **json.loads(sys.argv[1]),
}
os.environ["CYCLONEDDS_URI"] = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo' multicast='false'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>20</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers></Discovery>"
    "</Domain></CycloneDDS>"
)

import numpy as np
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

import messages as ros

RELIABLE = Policy.Reliability.Reliable(duration(milliseconds=100))
#: Lag of the arm behind its controller [s], springs of foam and ball under a tactel [N/m], radius of the ball [m].
LAG, SPRING, RADIUS = 0.02, 75.0, 0.04
PITCH, MOUNT, NOISE = 0.005, 0.03, 0.003


def rotation(rpy):
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])


def about(axis, angle):
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


class Arm:
    """The kinematics of a chain of revolute joints, read from a URDF."""

    def __init__(self, path):
        numbers = lambda text: np.array([float(part) for part in text.split()])
        self.names, self.joints = [], []
        for joint in xml.etree.ElementTree.parse(path).getroot().findall("joint"):
            if joint.get("type") == "revolute":
                origin = joint.find("origin")
                self.names.append(joint.get("name"))
                turn = rotation(numbers(origin.get("rpy")))
                self.joints.append((numbers(origin.get("xyz")), turn, numbers(joint.find("axis").get("xyz"))))

    def jacobian(self, q):
        """Returns the velocity of the origin of the tip, and its angular velocity, for each joint."""
        place, axes, columns = np.zeros(3), np.eye(3), []
        for angle, (xyz, turn, axis) in zip(q, self.joints):
            place, axes = place + axes @ xyz, axes @ turn
            columns.append((place, axes @ axis))
            axes = axes @ about(axis, angle)
        return np.array([[*np.cross(axis, place - origin), *axis] for origin, axis in columns]).T

    def pose(self, q):
        """Returns the place [m] and the axes of the pad."""
        place, axes = np.zeros(3), np.eye(3)
        for angle, (xyz, turn, axis) in zip(q, self.joints):
            place, axes = place + axes @ xyz, axes @ turn @ about(axis, angle)
        return place + axes @ [0, 0, MOUNT], axes


class Controller:
    """What moves the joints: a trajectory, or velocities with a watchdog."""

    def __init__(self, q):
        self.q, self.plan, self.velocity, self.fed = np.array(q), None, np.zeros(len(q)), -1.0
        self.taken, self.refused, self.ages = 0, 0, []
        self.strays = False

    def trajectory(self, message, now, names):
        """Takes a trajectory as `joint_trajectory_controller` does."""
        order = [message.joint_names.index(name) for name in names]
        begin = message.header.stamp.seconds() or now
        arrays = [(np.array(point.positions)[order], np.array(point.velocities)[order]) for point in message.points]
        times = [begin + point.time_from_start.seconds() for point in message.points]
        points = [(at, *posture) for at, posture in zip(times, arrays)]
        self.ages.append(now - begin)
        if points[-1][0] < now:
            self.refused += 1
            return
        if np.any(points[-1][2] != 0.0):
            raise SystemExit("a trajectory does not end at rest")
        self.taken += 1
        begins = [] if points[0][0] <= now else [(now, self.q.copy(), self.velocity.copy())]
        self.plan = begins + points

    def velocities(self, message, now):
        self.taken += 1
        self.velocity, self.fed = np.array(message.data), now

    def twist(self, message, now, jacobian):
        """Takes a twist as MoveIt Servo does."""
        begin = message.header.stamp.seconds()
        self.ages.append(now - begin)
        if message.header.frame_id != "base" or now - begin >= 0.1:
            self.refused += 1
            return
        linear, angular = message.twist.linear, message.twist.angular
        twist = np.array([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z])
        self.taken += 1
        self.velocity, self.fed = np.linalg.pinv(jacobian) @ twist, begin
        if self.strays and np.any(twist != 0.0):
            self.velocity[-1] += 8.0

    def step(self, now, dt):
        """Returns the commanded posture."""
        last = self.q.copy()
        if self.plan is not None:
            self.q = self.along(now)
            self.velocity = (self.q - last) / dt
        elif self.fed >= 0.0:
            self.velocity = self.velocity if now - self.fed < 0.1 else np.zeros(len(last))
            self.q = self.q + self.velocity * dt
        return self.q

    def along(self, now):
        """Cubic splines from point to point."""
        for (t0, q0, v0), (t1, q1, v1) in zip(self.plan, self.plan[1:]):
            if now < t1:
                span = t1 - t0
                s = max(now - t0, 0.0) / span
                return (
                    (2 * s**3 - 3 * s**2 + 1) * q0 + (s**3 - 2 * s**2 + s) * span * v0
                    + (3 * s**2 - 2 * s**3) * q1 + (s**3 - s**2) * span * v1
                )
        return self.plan[-1][1]


def topic(participant, name, kind):
    return Topic(participant, f"rt{name}", kind)


class Robot:
    def __init__(self):
        self.arm = Arm(SETTINGS["urdf"])
        self.participant = DomainParticipant(SETTINGS["domain"])
        best_effort = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1))
        reliable = Qos(RELIABLE, Policy.History.KeepLast(1))
        state_type = getattr(ros, SETTINGS["state_type"])
        self.states = self.writer("/joint_states", state_type, best_effort)
        self.twin = None
        pads = {"image": ros.Image, "array": ros.Float32MultiArray, "tactile_state": ros.TactileState}
        self.pad = None
        if SETTINGS["pad"]:
            self.pad = self.writer("/tactile", pads[SETTINGS["pad"]], best_effort)
        self.wrench_type = getattr(ros, SETTINGS["wrench_type"])
        self.wrench = self.writer("/wrench", self.wrench_type, best_effort)
        kinds = {"trajectory": "JointTrajectory", "velocity": "Float64MultiArray", "twist": "TwistStamped"}
        self.commands, self.rival = None, None
        self.command_kind = getattr(ros, SETTINGS["reader_type"] or kinds.get(SETTINGS["command"], "String"))
        if SETTINGS["reader_durability"] == "transient_local":
            reliable = Qos(RELIABLE, Policy.History.KeepLast(1), Policy.Durability.TransientLocal)
        if SETTINGS["command"]:
            self.command_topic = topic(self.participant, "/command", self.command_kind)
            self.commands = DataReader(self.participant, self.command_topic, qos=reliable)
        self.controller = Controller(SETTINGS["start"])
        self.q = np.array(SETTINGS["start"])
        # The ball is 6 mm in front of the pad, and two tactels from its middle.
        place, axes = self.arm.pose(self.q)
        self.ball = place + axes @ [0.010, -0.010, 0.006 + RADIUS]
        self.talks = self.sees = True
        self.fastest, self.random = 0.0, np.random.default_rng(1)

    def writer(self, name, kind, qos):
        return DataWriter(self.participant, topic(self.participant, name, kind), qos=qos)

    def cells(self):
        """The forces on the tactels [N]."""
        place, axes = self.arm.pose(self.q)
        x, y, z = axes.T @ (self.ball - place)
        at = (np.arange(SETTINGS["rows"]) - (SETTINGS["rows"] - 1) / 2) * PITCH
        aside = (at[None, :] - x) ** 2 + (at[:, None] - y) ** 2
        surface = z - np.sqrt(np.maximum(RADIUS**2 - aside, 0.0))
        pressed = np.where(aside < RADIUS**2, np.maximum(-surface, 0.0), 0.0) * SPRING
        return np.float32(np.maximum(pressed + self.random.normal(0.0, NOISE, pressed.shape), 0.0))

    def step(self, now, dt):
        if self.commands is not None:
            for message in self.commands.take(N=10):
                if isinstance(message, InvalidSample):
                    continue
                if self.command_kind is ros.JointTrajectory:
                    self.controller.trajectory(message, now, self.arm.names)
                elif self.command_kind is ros.Float64MultiArray:
                    self.controller.velocities(message, now)
                elif self.command_kind is ros.TwistStamped:
                    self.controller.twist(message, now, self.arm.jacobian(self.q))
        last = self.q
        self.q = last + (self.controller.step(now, dt) - last) * min(dt / LAG, 1.0)
        self.fastest = max(self.fastest, float(np.abs(self.q - last).max() / dt))

    def publish(self, now):
        stamp = ros.Time.of(now + SETTINGS["stamp_offset"])
        header = ros.Header(stamp=stamp, frame_id="base")
        if self.talks:
            if SETTINGS["state_type"] == "String":
                self.states.write(ros.String(data="hello"))
            else:
                self.states.write(self.joint_state(header))
                if self.twin is not None:
                    self.twin.write(self.joint_state(header))
        cells = self.cells()
        if self.pad is not None and self.sees:
            rows = SETTINGS["rows"]
            if SETTINGS["pad"] == "image":
                data = cells.astype("<f4").tobytes()
                image = ros.Image(header, rows, rows, "32FC1", 0, 4 * rows, list(data))
                self.pad.write(image)
            elif SETTINGS["pad"] == "array":
                dim = [ros.MultiArrayDimension("rows", rows, rows * rows), ros.MultiArrayDimension("cols", rows, rows)]
                self.pad.write(ros.Float32MultiArray(ros.MultiArrayLayout(dim, 0), cells.ravel().tolist()))
            else:
                channels = [ros.ChannelFloat32("thumb", [0.0]), ros.ChannelFloat32("palm", cells.ravel().tolist())]
                self.pad.write(ros.TactileState(header, channels))
        force = float(cells.sum())
        if self.wrench_type is ros.WrenchStamped:
            fx, fy, fz, tx, ty, tz = map(float, SETTINGS["wrench"] or [0, 0, -force, 0, 0, 0])
            self.wrench.write(ros.WrenchStamped(header, ros.Wrench(ros.Vector3(fx, fy, fz), ros.Vector3(tx, ty, tz))))
        return force

    def joint_state(self, header):
        names = self.arm.names if SETTINGS["names"] is None else SETTINGS["names"]
        known = dict(zip(self.arm.names, self.q.tolist()))
        position = [known.get(name, 0.0) for name in names]
        if SETTINGS["nan_at"] is not None and time.time() - BEGIN > SETTINGS["nan_at"]:
            position[0] = float("nan")
        return ros.JointState(header, list(names), position, [0.0] * len(names), [])

    def obey(self, word):
        if word == "second":
            self.rival = DataWriter(self.participant, self.command_topic, qos=Qos(RELIABLE))
        elif word == "twin":
            self.twin = self.writer("/joint_states", ros.JointState, Qos(Policy.Reliability.BestEffort))
        elif word == "stray":
            self.controller.strays = True
        elif word in ("quiet", "talk"):
            self.talks = word == "talk"
        elif word == "nan":
            SETTINGS["nan_at"] = 0.0
        elif word in ("blind", "see"):
            self.sees = word == "see"


BEGIN = time.time()


def main():
    robot, words = Robot(), []
    threading.Thread(target=lambda: [words.append(line) for line in sys.stdin], daemon=True).start()
    period, last, printed = 1.0 / SETTINGS["rate"], time.time(), 0.0
    due = last
    while True:
        now = time.time()
        robot.step(now, max(now - last, 1e-6))
        last = now
        force = robot.publish(now)
        while words:
            word = words.pop(0).strip()
            robot.obey(word)
            print(json.dumps({"heard": word}), flush=True)
        if now - printed > 0.02:
            printed = now
            controller = robot.controller
            line = {"t": now, "q": robot.q.tolist(), "speed": robot.fastest, "force": force}
            line |= {"taken": controller.taken, "refused": controller.refused, "ages": controller.ages}
            print(json.dumps(line), flush=True)
            robot.fastest, controller.ages = 0.0, []
        due = max(due + period, time.time() - 0.1)
        time.sleep(max(due - time.time(), 0.0))


main()
