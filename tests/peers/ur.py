#!/usr/bin/env python3
"""A robot of Universal Robots, as far as a driver sees it: RTDE, the port for programs, and the program that follows
velocities over a connection which the robot opens.

It is written from the description of the protocol and shares no code with the driver. The first argument is a JSON
object with settings (see DEFAULTS). The first line of the output names the ports; each line after it is something that
happened, with the time in seconds. Lines on the standard input change the robot: see `Robot.told`.
"""

import json
import math
import os
import re
import select
import socket
import struct
import sys
import time

DEFAULTS = {
    "rate": 125.0,              # steps per second
    "rtde_port": 0,             # where it listens; 0 is any free port
    "q": [0.0, -1.7, -2.0, -1.0124, 1.5708, 0.0],
    "protocol": True,           # whether it accepts version 2
    "version": [5, 12, 4, 0],   # of its software
    "not_found": [],            # outputs that it does not know
    "in_use": [],               # outputs that it refuses
    "chunk": 0,                 # bytes in each piece that it sends; 0 is all at once
    "remote": True,             # whether it takes programs
    "robot_mode": 7,
    "safety_mode": 1,
    "runtime_state": 1,
    "slider": 1.0,
    "payload": 0.5,
    "tcp_offset": [0.0] * 6,
    "tcp_error": 0.0,           # added to the x of the pose that it reports [m]
    "deflection": 0.0,          # added to the measured position of the elbow [rad]
    "force": [0.0] * 6,
    "lacks": [0.0] * 4,         # mass [kg] and centre in the flange [m] of what the payload lacks; the TCP is the flange
    "dials": 1,                 # connections that the program opens
    "texts": 0,                 # every so many samples, a text comes before a sample
    "from": "127.0.0.1",        # address from which it connects
    "late": 0.0,                # time until it answers [s]
    "drift": 1.0,               # rate of its clock
}

# Standard table of the UR5e: a, d [m] and alpha [rad].
TABLE = [
    (0.0, 0.1625, math.pi / 2), (-0.425, 0.0, 0.0), (-0.3922, 0.0, 0.0),
    (0.0, 0.1333, math.pi / 2), (0.0, 0.0997, -math.pi / 2), (0.0, 0.0996, 0.0),
]
SPEEDJ, STOPJ, PROTECTIVE = 40.0, 4.0, 20.0  # accelerations [rad/s^2]
VECTORS = {"actual_q", "actual_qd", "target_q", "target_qd", "actual_TCP_pose", "actual_TCP_speed", "actual_TCP_force",
           "tcp_offset"}
DOUBLES = {"timestamp", "speed_scaling", "target_speed_fraction", "payload"}
INTS = {"robot_mode", "safety_mode"}
UINTS = {"runtime_state", "robot_status_bits", "safety_status_bits"}


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def turn(v):
    """The matrix of a rotation vector."""
    angle = math.sqrt(sum(x * x for x in v))
    if angle < 1e-12:
        return [[1.0, 0, 0, 0], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]
    x, y, z = (c / angle for c in v)
    c, s = math.cos(angle), math.sin(angle)
    k = 1 - c
    return [[c + x * x * k, x * y * k - z * s, x * z * k + y * s, 0],
            [y * x * k + z * s, c + y * y * k, y * z * k - x * s, 0],
            [z * x * k - y * s, z * y * k + x * s, c + z * z * k, 0], [0, 0, 0, 1]]


def vector(m):
    """The rotation vector of a matrix."""
    w = [(m[2][1] - m[1][2]) / 2, (m[0][2] - m[2][0]) / 2, (m[1][0] - m[0][1]) / 2]
    sine, cosine = math.sqrt(sum(x * x for x in w)), (m[0][0] + m[1][1] + m[2][2] - 1) / 2
    angle = math.atan2(sine, cosine)
    if sine > 1e-6:
        return [x * angle / sine for x in w]
    if cosine > 0:
        return w
    # Half a turn: the largest diagonal element gives the axis.
    i = max(range(3), key=lambda i: m[i][i])
    axis = [(m[i][j] + m[j][i]) / 2 + (1 if i == j else 0) for j in range(3)]
    length = math.sqrt(sum(x * x for x in axis))
    return [angle * x / length for x in axis]


def tcp_pose(q, offset):
    pose = turn([0, 0, 0])
    for (a, d, alpha), angle in zip(TABLE, q):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        pose = times(pose, [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])
    tool = turn(offset[3:])
    for i in range(3):
        tool[i][3] = offset[i]
    pose = times(pose, tool)
    return [pose[0][3], pose[1][3], pose[2][3]] + vector(pose)


def weight(lacks, flange):
    """The force [N] and the torque [N m] of a weight on the flange, about its origin and along the axes of the base."""
    mass, *centre = lacks
    x, y, _ = (sum(flange[i][k] * centre[k] for k in range(3)) for i in range(3))
    down = -9.80665 * mass
    return [0.0, 0.0, down, y * down, -x * down, 0.0]


class Client:
    """A connection of RTDE."""

    def __init__(self, stream):
        self.stream, self.bytes, self.outputs, self.every, self.runs = stream, b"", [], 1, False


class Robot:
    def __init__(self, settings):
        self.s = {**DEFAULTS, **settings}
        self.dt = 1.0 / self.s["rate"]
        self.q, self.qd, self.wanted = list(self.s["q"]), [0.0] * 6, [0.0] * 6
        self.begin, self.steps, self.samples = time.monotonic(), 0, 0
        self.clients, self.scripts, self.kept = [], [], []
        self.reverse, self.bytes, self.deadline, self.stops_at = None, b"", None, STOPJ
        self.swallows, self.holds, self.rested, self.is_cut = False, False, True, False
        self.garbles = False
        self.program = None
        self.rtde, self.script = self.listen(self.s["rtde_port"]), self.listen(0)
        self.say(rtde=self.rtde.getsockname()[1], script=self.script.getsockname()[1])

    def listen(self, port):
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind(("127.0.0.1", port))
        listener.listen(8)
        return listener

    def now(self):
        return time.monotonic() - self.begin

    def say(self, **event):
        sys.stdout.write(json.dumps({"t": round(self.now(), 5), **event}) + "\n")
        sys.stdout.flush()

    # What the test says.

    def told(self, line):
        word, *rest = line.split()
        if word == "set":  # set slider 0.5
            self.s[rest[0]] = json.loads(rest[1])
        elif word == "move":  # a hand guides the robot: move q1 ... q6
            self.q = [float(angle) for angle in rest]
        elif word == "protective_stop":
            self.s["safety_mode"], self.s["runtime_state"], self.stops_at = 3, 4, PROTECTIVE
            self.wanted = [0.0] * 6
        elif word == "unlock":
            self.s["safety_mode"] = 1
            self.end("the program is stopped after the unlock")
        elif word == "pause":
            self.s["runtime_state"], self.wanted, self.stops_at = 4, [0.0] * 6, STOPJ
        elif word == "play_on":
            self.s["runtime_state"] = 2
        elif word == "stop_program":
            self.end("stopped on the pendant")
        elif word == "dial":  # one more connection of the program
            self.dial(self.program, is_second=True)
        elif word == "urcap":  # press play: the node asks for its program
            self.ask(int(rest[0]))
        elif word == "cut":  # in the middle of a sample
            self.is_cut = True
        elif word == "swallow":
            self.swallows = rest[0] == "true"
        elif word == "hold":
            self.holds = rest[0] == "true"
        elif word == "garble":  # packets come, but no samples
            self.garbles = rest[0] == "true"
        elif word == "bytes":
            for client in self.clients:
                self.put(client, bytes.fromhex(rest[0]))
        elif word != "mark":
            raise ValueError(line)
        self.say(told=line)

    # The program.

    def ask(self, port):
        text = b""
        try:
            with socket.create_connection(("127.0.0.1", port), timeout=5, source_address=self.own()) as stream:
                stream.sendall(b"request_program\n")
                while part := stream.recv(65536):
                    text += part
        except OSError as error:
            self.say(asked=str(error))
        self.run(text.decode())

    def run(self, text):
        """Runs the program of a text, as far as it is understood here: where it connects to."""
        if self.s["runtime_state"] == 2:
            self.end("another program is sent")
        is_vendor = "trajectory_socket" in text
        if is_vendor:
            found = re.findall(r'connect_socket_with_retry\("([^"]+)", (\d+), "(\w+)"\)', text)
            targets = {name: (host, int(port)) for host, port, name in found}
            for name in ("trajectory_socket", "script_command_socket"):
                self.kept.append(socket.create_connection(targets[name], timeout=5))
            self.program = targets["reverse_socket"]
        else:
            found = re.search(r'socket_open\("([^"]+)", (\d+),', text)
            self.program = (found[1], int(found[2])) if found else None
        has_stop = "stopj(4.0)" in text or "STOPJ_ACCELERATION = 4.0" in text
        self.say(program=len(text), is_vendor=is_vendor, to=self.program, has_stop=has_stop, has_open="{{" in text)
        if self.program is None:
            return
        self.s["runtime_state"] = 2
        for i in range(self.s["dials"]):
            self.dial(self.program, is_second=i > 0)

    def own(self):
        return self.s["from"], 0

    def dial(self, target, is_second=False):
        try:
            stream = socket.create_connection(target, timeout=5, source_address=self.own())
        except OSError as error:
            self.say(dialled=str(error))
            return self.end("no connection")
        stream.setblocking(False)
        if is_second:
            self.kept.append(stream)
        else:
            self.reverse, self.bytes, self.deadline = stream, b"", time.monotonic() + 1.0
        self.say(dialled="second" if is_second else "first")

    def end(self, why):
        """The robot stops by itself, and the program ends."""
        if self.reverse is not None:
            self.reverse.close()
            self.reverse = None
        if self.s["runtime_state"] != 1:
            self.say(ended=why, speed=max(map(abs, self.qd)))
        self.s["runtime_state"], self.wanted, self.deadline = 1, [0.0] * 6, None
        self.stops_at = STOPJ
        for stream in self.kept:
            stream.close()
        self.kept = []

    def follow(self):
        """Reads messages, as long as the program runs."""
        if self.reverse is None or self.s["runtime_state"] != 2:
            return
        is_closed = False
        while not self.holds:
            try:
                part = self.reverse.recv(65536)
            except BlockingIOError:
                break
            except OSError:
                part = b""
            if not part:
                is_closed = True
                break
            if not self.swallows:
                self.bytes += part
        while len(self.bytes) >= 32:
            fields = struct.unpack(">8i", self.bytes[:32])
            self.bytes = self.bytes[32:]
            timeout, mode = fields[0], fields[7]
            velocity = [field / 1e6 for field in fields[1:7]]
            self.say(timeout=timeout, qd=velocity, mode=mode)
            self.deadline = time.monotonic() + timeout / 1e3 if timeout > 0 else None
            self.wanted, self.stops_at = (velocity, SPEEDJ) if mode == 2 else ([0.0] * 6, STOPJ)
            if mode == -2:
                return self.end("asked to")
        if is_closed:
            self.end("the connection is closed")
        elif self.deadline is not None and time.monotonic() > self.deadline:
            self.end("silence")

    def step(self):
        """Moves the joints for one step."""
        self.steps += 1
        slider = self.s["slider"]
        for i in range(6):
            most = self.stops_at * self.dt
            change = self.wanted[i] * slider - self.qd[i]
            self.qd[i] += max(-most, min(most, change))
            self.q[i] += self.qd[i] * self.dt
        speed = max(map(abs, self.qd))
        if speed > 0 or not self.rested:
            self.say(speed=speed)
        self.rested = speed == 0

    # RTDE.

    def value(self, name):
        s, q = self.s, list(self.q)
        measured = [x + (s["deflection"] if i == 2 else 0.0) for i, x in enumerate(q)]
        if name == "actual_TCP_pose":
            pose = tcp_pose(measured, s["tcp_offset"])
            return [pose[0] + s["tcp_error"]] + pose[1:]
        if name == "actual_TCP_force":
            return [a + b for a, b in zip(s["force"], weight(s["lacks"], turn(tcp_pose(measured, s["tcp_offset"])[3:])))]
        return {
            "timestamp": 1000.0 + self.steps * self.dt * s["drift"], "actual_q": measured, "target_q": q,
            "actual_qd": self.qd, "target_qd": self.qd, "actual_TCP_speed": [0.0] * 6,
            "tcp_offset": s["tcp_offset"], "payload": s["payload"], "robot_mode": s["robot_mode"],
            "safety_mode": s["safety_mode"], "runtime_state": s["runtime_state"], "speed_scaling": s["slider"],
            "target_speed_fraction": s["slider"], "robot_status_bits": 3, "safety_status_bits": 1,
        }[name]

    def kind(self, name):
        if name in self.s["not_found"]:
            return "NOT_FOUND"
        if name in self.s["in_use"]:
            return "IN_USE"
        for names, kind in ((VECTORS, "VECTOR6D"), (DOUBLES, "DOUBLE"), (INTS, "INT32"), (UINTS, "UINT32")):
            if name in names:
                return kind
        found = re.fullmatch(r"(?:in|out)put_(bit|int|double)_register_\d+", name)
        if found:
            return {"bit": "BOOL", "int": "INT32", "double": "DOUBLE"}[found[1]]
        return "NOT_FOUND"

    def sample(self, client):
        payload = b"\x01"
        for name, kind in client.outputs:
            if kind == "BOOL":
                payload += b"\x00"
            elif "_register_" in name:
                payload += struct.pack({"INT32": ">i", "DOUBLE": ">d"}[kind], 0)
            elif kind == "VECTOR6D":
                payload += struct.pack(">6d", *self.value(name))
            else:
                payload += struct.pack({"DOUBLE": ">d", "INT32": ">i", "UINT32": ">I"}[kind], self.value(name))
        return self.packet(b"U", payload)

    @staticmethod
    def packet(command, payload):
        return struct.pack(">H", 3 + len(payload)) + command + payload

    def put(self, client, data):
        size = self.s["chunk"] or len(data)
        try:
            for i in range(0, len(data), size):
                client.stream.sendall(data[i:i + size])
        except OSError:
            self.drop(client)

    def drop(self, client):
        client.stream.close()
        if client in self.clients:
            self.clients.remove(client)

    def hear(self, client):
        try:
            part = client.stream.recv(65536)
        except OSError:
            part = b""
        if not part:
            return self.drop(client)
        client.bytes += part
        while len(client.bytes) >= 3:
            size = struct.unpack(">H", client.bytes[:2])[0]
            if size < 3 or len(client.bytes) < size:
                break
            command, payload = client.bytes[2:3], client.bytes[3:size]
            self.say(rtde=client.bytes[:size].hex())
            client.bytes = client.bytes[size:]
            self.answer(client, command, payload)

    def answer(self, client, command, payload):
        if command == b"V":
            is_good = self.s["protocol"] and struct.unpack(">H", payload)[0] == 2
            self.put(client, self.packet(b"V", bytes([is_good])))
        elif command == b"v":
            self.put(client, self.packet(b"v", struct.pack(">4I", *self.s["version"])))
        elif command == b"O":
            # Some clients end the list with a comma.
            rate, names = struct.unpack(">d", payload[:8])[0], payload[8:].decode().rstrip(",").split(",")
            client.outputs = [(name, self.kind(name)) for name in names]
            client.every = max(1, round(self.s["rate"] / rate))
            kinds = ",".join(kind for _, kind in client.outputs)
            is_bad = any(kind in ("NOT_FOUND", "IN_USE") for _, kind in client.outputs)
            self.put(client, self.packet(b"O", bytes([0 if is_bad else 1]) + kinds.encode()))
        elif command == b"I":
            kinds = ",".join(self.kind(name) for name in payload.decode().split(","))
            self.put(client, self.packet(b"I", b"\x01" + kinds.encode()))
        elif command in (b"S", b"P"):
            # A text may come between any two packets.
            self.text(client, "hello")
            self.put(client, self.packet(command, b"\x01"))
            client.runs = command == b"S"

    def text(self, client, words):
        words, source = words.encode(), b"RTDE"
        body = bytes([len(words)]) + words + bytes([len(source)]) + source + b"\x03"
        self.put(client, self.packet(b"M", body))

    def tell(self):
        """Sends a sample to each client that has started."""
        if self.swallows:
            return
        due = [client for client in self.clients if client.runs and self.steps % client.every == 0]
        for client in due:
            self.samples += 1
            if self.s["texts"] and self.samples % self.s["texts"] == 0:
                self.text(client, "a text between samples")
            sample = self.packet(b"Z", b"\x01") if self.garbles else self.sample(client)
            if self.is_cut:
                self.put(client, sample[:len(sample) // 2])
                self.drop(client)
            else:
                self.put(client, sample)
        self.is_cut = self.is_cut and not due

    # The loop.

    def take_programs(self):
        for entry in list(self.scripts):
            stream, text = entry
            try:
                part = stream.recv(65536)
            except BlockingIOError:
                continue
            except OSError:
                part = b""
            entry[1] += part
            if not part:
                self.scripts.remove(entry)
                stream.close()
            elif re.search(rb"^end\n", entry[1], re.M):
                text, entry[1] = entry[1].decode(), b""
                if self.s["remote"]:
                    self.run(text)
                else:
                    self.say(ignored=len(text))

    def loop(self):
        time.sleep(self.s["late"])
        self.begin += self.s["late"]
        os.set_blocking(0, False)
        words = b""
        while True:
            due = self.begin + (self.steps + 1) * self.dt
            readers = [0, self.rtde, self.script] + [client.stream for client in self.clients]
            readers += [self.reverse] if self.reverse is not None and not self.holds else []
            ready, _, _ = select.select(readers, [], [], max(0.0, min(due - time.monotonic(), 0.01)))
            if 0 in ready:
                part = os.read(0, 65536)
                if not part:
                    return
                words += part
                *lines, words = words.split(b"\n")
                for line in lines:
                    self.told(line.decode())
            if self.rtde in ready:
                stream, _ = self.rtde.accept()
                stream.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.clients.append(Client(stream))
            if self.script in ready:
                stream, _ = self.script.accept()
                stream.setblocking(False)
                self.scripts.append([stream, b""])
            for client in [client for client in self.clients if client.stream in ready]:
                self.hear(client)
            self.take_programs()
            self.follow()
            while time.monotonic() >= self.begin + (self.steps + 1) * self.dt:
                self.follow()
                self.step()
                self.tell()


Robot(json.loads(sys.argv[1]) if len(sys.argv) > 1 else {}).loop()
