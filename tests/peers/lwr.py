"""The controller of a KUKA LWR 4+ as FRI 1.0 shows it, with an arm that follows. Python's standard library only.

It sends measurements (MSR, 916 bytes) to a UDP port and expects an answer (CMD, 376 bytes) to each. Its KRL program
waits in the state monitor until the quality of the connection is perfect, and starts the state command. Without answers
the quality falls, and below ok the session drops to monitor and the arm stops. Events disturb all this at given times.
It checks every answer, and prints what it saw as lines of JSON: `state` and `do` when they happen, `cycle` for each
measurement with `--cycles`, and `end` with all counts.

With `--guided`, a person guides the arm by hand. Each line on the standard input is `move q1 … q7` [rad], which puts it
there at once, `drift V`, which turns the first joint at V rad/s, or `quiet`, which ends the measurements. Each is
answered with the event `told`. The controller ends with the standard input.

    python3 lwr.py --port 49938 --seconds 5 --events '[{"at": 1.0, "do": "lose", "count": 5}]'
"""

import argparse
import json
import math
import os
import select
import signal
import socket
import struct
import sys
import time

MSR, MSR_ID, CMD, CMD_ID = 916, 0x2006, 376, 0x1005
OFF, MONITOR, COMMAND = 0, 1, 2
JOINT_POSITION, JOINT_STIFFNESS, JOINT_DAMPING = 0x1, 0x10, 0x20
HOME = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]
# The published parameters of Denavit and Hartenberg: for each joint, the displacement along z [m] and the twist about x
# [quarter turns].
TABLE = [(0.310, 1), (0.0, -1), (0.400, -1), (0.0, 1), (0.390, 1), (0.0, -1), (0.078, 0)]
OLD_S = 0.2  # age of a measurement that nobody may answer any more
EXTRAPOLATED = 5  # cycles without an answer in which the arm goes on


GRAVITY = 9.80665  # [m/s2]


def f32(value):
    return struct.unpack("<f", struct.pack("<f", value))[0]


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def flange(q):
    """The rows of the pose of the flange in the base."""
    pose = [[float(i == j) for j in range(4)] for i in range(4)]
    for (d, twist), angle in zip(TABLE, q):
        c, s, ca, sa = math.cos(angle), math.sin(angle), float(twist == 0), float(twist)
        pose = times(pose, [[c, -s * ca, s * sa, 0], [s, c * ca, -c * sa, 0], [0, sa, ca, d], [0, 0, 0, 1]])
    return [value for row in pose[:3] for value in row]


def weight(mass, centre, pose):
    """The force [N] and the torque [N m] of a mass [kg] with its centre [m] in the frame of the flange."""
    # The third row of the rotation is the vertical in the axes of the flange.
    force = [-mass * GRAVITY * up for up in pose[8:11]]
    torque = [centre[i - 2] * force[i - 1] - centre[i - 1] * force[i - 2] for i in range(3)]
    return force + torque


class Controller:
    def __init__(self, args):
        self.args, self.dt = args, args.sample_ms * 1e-3
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        # The port that it sends from is not the one that it sends to.
        self.socket.bind(("127.0.0.1", 0))
        self.stranger = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.target = ("127.0.0.1", args.port)
        # Its own program is where an offset takes the arm home: only the sum of both fields is the posture.
        self.krl, self.measured, self.total = [f32(q + 0.01) for q in args.home], [q + args.sag for q in args.home], args.home[:]
        self.last_step, self.missed, self.state, self.power, self.error = [0.0] * 7, 0, MONITOR, 0x7F, 0
        self.control, self.forced, self.sequence, self.time = args.control, None, 0, 0.0
        self.begin = time.monotonic()
        self.heard, self.answers, self.perfect_since, self.first_command = None, 0, None, None
        self.dropped, self.events = None, list(args.events)
        # What was sent: for each number, whether positions are taken and the posture that is commanded.
        self.sent, self.answered, self.newest = {}, set(), None
        self.lost, self.held, self.swallowed, self.ints = 0, [], 0, [0] * 16
        self.last, self.entered, self.fresh = None, False, None
        self.frozen, self.kept, self.orders, self.is_left = False, [], b"", False
        self.drift, self.is_quiet = 0.0, False
        self.counts = {
            "sent": 0, "answers": 0, "bad_answers": 0, "mirror_errors": 0, "flag_errors": 0, "sequence_errors": 0,
            "unknown_answers": 0, "stranger_answers": 0, "old_answers": 0, "drops": 0, "commands": 0,
        }
        self.largest_step = self.entry_jump = self.largest_lead = 0.0
        self.flags, self.impedance, self.round_trips = [], None, []

    def say(self, event, **more):
        print(json.dumps({"event": event, "t": round(time.monotonic() - self.begin, 4), **more}), flush=True)

    def takes(self):
        return self.state == COMMAND and self.power != 0

    def commanded(self):
        """The posture that the controller commands, as its two fields add up on the wire."""
        offset = [f32(t - k) for t, k in zip(self.total, self.krl)]
        return [f32(f32(k) + o) for k, o in zip(self.krl, offset)], offset

    def quality(self):
        if self.forced is not None:
            return self.forced
        if self.heard is None or self.answers < 20:
            return 0
        third = self.args.silence_ms * 1e-3 / 3
        return max(0, 3 - int((time.monotonic() - self.heard) / third))

    def datagram(self, sequence):
        commanded, offset = self.commanded()
        bytes_ = bytearray(MSR)
        struct.pack_into("<4H", bytes_, 0, sequence, 0, MSR, MSR_ID)
        struct.pack_into("<16f16iH", bytes_, 8, *[0.5] * 16, *range(100, 116), 0x8001)
        struct.pack_into("<fHHff", bytes_, 140, f32(self.time), self.state, self.quality(), f32(self.dt), f32(self.dt))
        struct.pack_into("<HHH", bytes_, 180, self.power, self.control, self.error)
        struct.pack_into("<7f", bytes_, 216, *self.measured)
        struct.pack_into("<12f", bytes_, 244, *self.pose())
        struct.pack_into("<7f", bytes_, 292, *self.krl)
        struct.pack_into("<7f", bytes_, 320, *offset)
        of_tool = weight(self.args.tool[0], self.args.tool[1:], flange(self.measured))
        x, y, z, tx, ty, tz = [a + b for a, b in zip(self.args.wrench, of_tool)]
        struct.pack_into("<6f", bytes_, 500, x, y, z, tz, ty, tx)
        self.sent[sequence] = {"takes": self.takes(), "state": self.state, "commanded": commanded, "at": time.monotonic()}
        self.sent.pop((sequence - 2000) % 65536, None)
        self.newest = sequence
        self.kept = [*self.kept[-149:], bytes(bytes_)]
        return bytes(bytes_)

    def pose(self):
        pose = flange(self.measured)
        pose[3] += self.args.pose_off
        return pose

    def receive(self, until):
        """Takes answers up to a moment."""
        while True:
            left = until - time.monotonic()
            ready, _, _ = select.select([self.socket, self.stranger], [], [], max(0.0, left))
            if not ready:
                return
            if self.stranger in ready:
                self.stranger.recv(1000)
                self.counts["stranger_answers"] += 1
            if self.socket in ready:
                bytes_ = self.socket.recv(1000)
                self.check(bytes_, self.swallowed > 0)
                self.swallowed = max(0, self.swallowed - 1)

    def check(self, bytes_, is_swallowed):
        """Checks an answer. The controller does not get one that is swallowed."""
        self.counts["answers"] += 1
        if len(bytes_) != CMD or struct.unpack_from("<HH", bytes_, 4) != (CMD, CMD_ID):
            self.counts["bad_answers"] += 1
            return
        sequence, reflected = struct.unpack_from("<HH", bytes_, 0)
        sent = self.sent.get(reflected)
        if sent is None:
            self.counts["unknown_answers"] += 1
            return
        age = time.monotonic() - sent["at"]
        self.round_trips.append(age)
        if age > OLD_S:
            self.counts["old_answers"] += 1
        (flags,) = struct.unpack_from("<I", bytes_, 140)
        position = list(struct.unpack_from("<7f", bytes_, 144))
        self.ints = list(struct.unpack_from("<16i", bytes_, 72))
        impedance = (struct.unpack_from("<7f", bytes_, 272), struct.unpack_from("<7f", bytes_, 300))
        newest = self.sent[self.newest]
        is_mirror = position in (sent["commanded"], newest["commanded"])
        if not sent["takes"] and not newest["takes"] and not is_mirror:
            self.counts["mirror_errors"] += 1
        if self.last is not None:
            if sequence != (self.last["sequence"] + 1) % 65536:
                self.counts["sequence_errors"] += 1
            has_changed = flags != self.last["flags"] or impedance != self.impedance
            if has_changed and MONITOR not in (sent["state"], newest["state"]):
                self.counts["flag_errors"] += 1
        if flags not in self.flags:
            self.flags.append(flags)
        if sent["takes"] and reflected not in self.answered:
            if not self.entered:
                self.entry_jump = max(self.entry_jump, *(abs(a - b) for a, b in zip(position, sent["commanded"])))
            else:
                # From where the driver was, or from where the controller is after a gap.
                froms = (self.last["position"], sent["commanded"])
                step = min(max(abs(a - b) for a, b in zip(position, start)) for start in froms)
                self.largest_step = max(self.largest_step, step)
            self.counts["commands"] += 1
        self.entered = sent["takes"]
        self.last = {"sequence": sequence, "flags": flags, "position": position}
        self.impedance = impedance
        self.answered.add(reflected)
        if is_swallowed:
            return
        self.heard, self.answers = time.monotonic(), self.answers + 1
        if flags & JOINT_POSITION:
            self.fresh = position

    def move(self):
        """The arm for a cycle: it follows the newest answer, or goes on for a while without one."""
        before = self.total
        if self.frozen:
            pass
        elif self.takes() and self.fresh is not None:
            self.total, self.missed = self.fresh, 0
        elif self.takes() and self.missed < EXTRAPOLATED:
            self.total, self.missed = [a + b for a, b in zip(self.total, self.last_step)], self.missed + 1
        self.last_step = [a - b for a, b in zip(self.total, before)] if self.takes() else [0.0] * 7
        self.fresh = None
        share = 1.0 - math.exp(-self.dt / self.args.lag_s) if self.args.lag_s else 1.0
        self.measured = [m + share * (t + self.args.sag - m) for m, t in zip(self.measured, self.total)]
        self.largest_lead = max(self.largest_lead, *(abs(t - m) for t, m in zip(self.total, self.measured)))

    def guide(self):
        """Takes what a person has written on the standard input."""
        while self.args.guided and select.select([0], [], [], 0)[0]:
            data = os.read(0, 4096)
            self.args.guided, self.is_left = data != b"", data == b""
            *lines, self.orders = (self.orders + data).split(b"\n")
            for word, *numbers in (line.decode().split() for line in lines):
                numbers = [float(number) for number in numbers]
                if word == "move":
                    assert len(numbers) == 7, numbers
                    self.total, self.drift = [f32(number) for number in numbers], 0.0
                elif word == "drift":
                    (self.drift,) = numbers
                else:
                    assert word == "quiet", word
                    self.is_quiet = True
                self.measured = [q + self.args.sag for q in self.total]
                self.say("told", what=word)
        if self.drift:
            self.total = [self.total[0] + self.drift * self.dt, *self.total[1:]]
            self.measured = [q + self.args.sag for q in self.total]

    def enter(self, state):
        if state == self.state:
            return
        if self.state == COMMAND:
            # The arm stops where it is.
            self.counts["drops"] += 1
            self.dropped = time.monotonic()
        self.total, self.last_step, self.fresh = self.commanded()[0], [0.0] * 7, None
        self.state = state
        if state == COMMAND and self.first_command is None:
            self.first_command = time.monotonic()
        self.say("state", state=state)

    def program(self):
        """The KRL program: it starts the state command once the quality is perfect."""
        args, now = self.args, time.monotonic()
        if self.state == COMMAND and (self.quality() < 2 or args.stop_int and self.ints[args.stop_int[0] - 1] == args.stop_int[1]):
            return self.enter(MONITOR)
        if self.state != MONITOR or args.only_monitor:
            return None
        is_ready = self.quality() == 3 and (not args.start_int or self.ints[args.start_int[0] - 1] == args.start_int[1])
        self.perfect_since = (self.perfect_since or now) if is_ready else None
        may_restart = self.dropped is None or (args.restart_s is not None and now - self.dropped > args.restart_s)
        if is_ready and may_restart and now - self.perfect_since >= args.start_s:
            self.enter(COMMAND)
        return None

    def due(self):
        now = time.monotonic()
        for event in self.events:
            zero = self.begin if event.get("from") == "start" else self.first_command
            if zero is not None and now - zero >= event["at"]:
                self.events.remove(event)
                return event
        return None

    def send(self, bytes_):
        self.socket.sendto(bytes_, self.target)
        self.counts["sent"] += 1

    def act(self, event, bytes_):
        """Does an event. Returns whether the measurement of this cycle is sent as usual."""
        do, count = event["do"], event.get("count", 1)
        self.say("do", what=do, total=self.total)
        signals = {"stop_process": signal.SIGSTOP, "continue_process": signal.SIGCONT, "kill_process": signal.SIGKILL}
        if do in signals:
            os.kill(self.args.pid, signals[do])
        elif do == "lose":
            self.lost = count
            return self.usual(bytes_)
        elif do == "duplicate":
            self.send(bytes_)
        elif do == "hold":  # sends this one and the next ones together, the newest first if they are swapped
            self.held, self.hold, self.swap = [], count, event.get("swap", False)
            return self.usual(bytes_)
        elif do == "old":
            self.socket.sendto(self.kept[0], self.target)
        elif do == "short":
            self.socket.sendto(bytes_[:-1], self.target)
        elif do == "long":
            self.socket.sendto(bytes_ + b"\0", self.target)
        elif do == "wrong_id":
            self.socket.sendto(bytes_[:6] + b"\x05\x10" + bytes_[8:], self.target)
        elif do == "not_finite":
            self.socket.sendto(bytes_[:216] + b"\0\0\xc0\x7f" + bytes_[220:], self.target)
        elif do == "stranger":
            for _ in range(count):
                self.stranger.sendto(bytes_, self.target)
        elif do == "monitor":
            self.enter(MONITOR)
        elif do == "swallow":
            self.swallowed = count
        elif do == "restart":  # of the numbers of the datagrams
            self.sequence = 30000
        else:
            setattr(self, {"quality": "forced"}.get(do, do), event["value"])
        return True

    hold, swap = 0, False

    def usual(self, bytes_):
        """Sends a measurement, unless an event holds it back or loses it."""
        if self.lost:
            self.lost -= 1
        elif self.hold:
            self.held.append(bytes_)
            self.hold -= 1
            if not self.hold:
                for held in reversed(self.held) if self.swap else self.held:
                    self.send(held)
        else:
            self.send(bytes_)
        return False

    def run(self):
        due, end = time.monotonic(), self.begin + self.args.seconds
        while time.monotonic() < end and not self.is_over():
            self.move()
            self.guide()
            self.program()
            self.sequence = (self.sequence + 1) % 65536
            event = self.due()
            bytes_ = self.datagram(self.sequence)
            if not self.is_quiet and (event is None or self.act(event, bytes_)):
                self.usual(bytes_)
            if self.args.cycles:
                told = [round(q, 9) for q in self.total]
                self.say("cycle", state=self.state, quality=self.quality(), total=told)
            self.time += self.dt
            due = max(due + self.dt, time.monotonic() - 0.1)
            self.receive(due)
        self.receive(time.monotonic() + 0.05)
        self.finish()

    def is_over(self):
        """Whether the driver has left: it answers no more, after it did."""
        is_silent = self.heard is not None and time.monotonic() - self.heard > 1.0
        return self.is_left or self.args.until_silent and is_silent and not self.events

    def finish(self):
        trips = sorted(self.round_trips) or [0.0]
        at = lambda share: round(trips[int((len(trips) - 1) * share)] * 1e3, 4)
        self.say(
            "end", **self.counts, answered=len(self.answered), largest_step=self.largest_step, entry_jump=self.entry_jump,
            largest_lead=self.largest_lead, flags=self.flags, impedance=self.impedance, ints=self.ints, state=self.state,
            total=self.total, round_trip_ms=[at(0.5), at(0.99)],
        )


def main():
    sys.stdout.reconfigure(line_buffering=True)
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, required=True)
    parser.add_argument("--sample-ms", type=float, default=4.0)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--silence-ms", type=float, default=150.0)
    parser.add_argument("--lag-s", type=float, default=0.0, help="time constant of the arm; 0 if it follows at once")
    parser.add_argument("--sag", type=float, default=0.003, help="of each joint below its command [rad]")
    parser.add_argument("--control", type=int, default=3)
    parser.add_argument("--start-s", type=float, default=0.1)
    parser.add_argument("--restart-s", type=float, help="time after which the program starts again after a drop")
    parser.add_argument("--start-int", type=int, nargs=2, help="number and value of the integer that starts the program")
    parser.add_argument("--stop-int", type=int, nargs=2)
    parser.add_argument("--only-monitor", action="store_true")
    parser.add_argument("--until-silent", action="store_true")
    parser.add_argument("--cycles", action="store_true")
    parser.add_argument("--pid", type=int)
    parser.add_argument("--pose-off", type=float, default=0.0, help="how far the reported flange is off along x [m]")
    parser.add_argument("--home", type=float, nargs=7, default=HOME)
    parser.add_argument("--wrench", type=float, nargs=6, default=[0.0] * 6, help="fx fy fz tx ty tz [N, N m]")
    parser.add_argument("--tool", type=float, nargs=4, default=[0.0] * 4, help="mass [kg] and centre x y z [m] in the flange")
    parser.add_argument("--guided", action="store_true")
    parser.add_argument("--events", type=json.loads, default=[])
    Controller(parser.parse_args()).run()


if __name__ == "__main__":
    main()
