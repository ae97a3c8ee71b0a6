"""A simulator of a tactile pad on a KUKA LWR 4+, for the lockstep bridge: a second opinion on the graphs.

Everything is written out here, with other physics than the built-in bench: joints in impedance with a constant inertia, a
pad as an elastic foundation of points 1 mm apart whose forces a Gaussian spreads over the tactels, viscous friction that
grows to Coulomb's. It listens, prints its port, serves one graph and prints what it saw as a line of JSON.

    python3 simulator.py --scene ball --offset 0.01 0 --seconds 20 --port 7777
"""

import argparse
import json
import math
import random
import select
import socket
import sys
import time

DT, SUBSTEPS = 0.004, 4
ROWS = COLS = 16
PITCH, FINE = 0.005, 5
NEWTON, COUNTS, THRESHOLD = 0.1, 102.375, 0.15
START = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]
SENSOR = 0.03
NAMES = [f"lwr_{name}_joint" for name in ("a1", "a2", "e1", "a3", "a4", "a5", "a6")]
Q_MAX = [math.radians(degrees) for degrees in (170, 120, 170, 120, 170, 120, 170)]
DQ_MAX = [math.radians(degrees) for degrees in (110, 110, 128, 128, 204, 184, 184)]
# The way up the arm: a shift along z before each joint [m], and the joint's axis.
CHAIN = [(0.11, "z"), (0.2005, "-y"), (0.2, "z"), (0.2, "y"), (0.2, "z"), (0.19, "-y"), (0.078, "z")]
INERTIA = [2.5, 2.5, 1.2, 1.0, 0.25, 0.25, 0.08]
STIFFNESS, DAMPING_RATIO = 200.0, 0.2
FOAM, FOAM_SOFT, FOAM_CUBIC, FOAM_DAMPING = 350.0, 0.0025, 8e7, 0.02
SPREAD, FRICTION, CREEP_SPEED = 0.003, 0.35, 0.003


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def turn(rotation, axis, angle):
    """A rotation, as its three columns, turned about one of its own axes."""
    sin, cos = math.sin(angle), math.cos(angle)
    x, y, z = rotation
    if axis == "z":
        return [[c * cos + s * sin for c, s in zip(x, y)], [s * cos - c * sin for c, s in zip(x, y)], z]
    if axis == "-y":
        sin = -sin
    return [[c * cos - s * sin for c, s in zip(x, z)], y, [s * cos + c * sin for c, s in zip(x, z)]]


def forward(q):
    """Axes (columns) and origin of the sensor, and axis and point of each joint."""
    rotation, at, joints = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [0.0, 0.0, 0.0], []
    for (shift, axis), angle in zip(CHAIN, q):
        at = [a + shift * z for a, z in zip(at, rotation[2])]
        about = rotation[2] if axis == "z" else rotation[1] if axis == "y" else [-c for c in rotation[1]]
        joints.append((about, at))
        rotation = turn(rotation, axis, angle)
    return rotation, [a + SENSOR * z for a, z in zip(at, rotation[2])], joints


class Scene:
    """An object in the axes of the sensor at the start: how deep a point is in it [m]."""

    def __init__(self, args):
        self.kind, self.gap, self.radius = args.scene, args.gap, args.radius
        self.x, self.y = args.offset
        self.sin, self.cos = math.sin(args.angle), math.cos(args.angle)
        bends = [math.sin(0.4 * i) * 0.012 for i in range(-6, 7)]
        self.path = [(0.02 * i, bend) for i, bend in zip(range(-6, 7), bends)]

    def depth(self, x, y, z):
        x, y, z = x - self.x, y - self.y, z - self.gap
        if self.kind == "none":
            return -1.0
        if self.kind == "plane":
            return z
        along, across = x * self.cos + y * self.sin, y * self.cos - x * self.sin
        if self.kind == "edge":
            return min(z, 2.0 * across)
        z -= self.radius
        if self.kind == "ball":
            return self.radius - math.sqrt(x * x + y * y + z * z)
        if self.kind == "pen":
            return self.radius - math.sqrt(across * across + z * z)
        nearest = min(self.to_piece(along, across, a, b) for a, b in zip(self.path, self.path[1:]))
        return self.radius - math.sqrt(nearest + z * z)

    @staticmethod
    def to_piece(along, across, a, b):
        """Square of the distance from a piece of the cable, in its plane."""
        (ax, ay), (bx, by) = a, b
        dx, dy = bx - ax, by - ay
        share = max(0.0, min(1.0, ((along - ax) * dx + (across - ay) * dy) / (dx * dx + dy * dy)))
        x, y = along - ax - share * dx, across - ay - share * dy
        return x * x + y * y


class World:
    def __init__(self, args):
        self.scene, self.random = Scene(args), random.Random(args.seed)
        self.q, self.q_eq, self.dq = START[:], START[:], [0.0] * 7
        self.axes0, self.at0, _ = forward(START)
        self.gains = [math.exp(self.random.gauss(0.0, 0.05)) for _ in range(ROWS * COLS)]
        self.places = [((i + 0.5) / FINE * PITCH - COLS * PITCH / 2) for i in range(COLS * FINE)]
        self.centres = [(j + 0.5 - COLS / 2) * PITCH for j in range(COLS)]
        self.spread = [self.weights(place) for place in self.places]
        self.force, self.middle, self.stiffness, self.points = 0.0, None, 0.0, []

    def weights(self, place):
        """What share of a force at `place` each tactel along a line gets."""
        def below(x):
            return 0.5 * (1.0 + math.erf((x - place) / SPREAD / math.sqrt(2.0)))
        shares = [(j, below(c + PITCH / 2) - below(c - PITCH / 2)) for j, c in enumerate(self.centres)]
        return [(j, share) for j, share in shares if share > 1e-4]

    def local(self, axes, at):
        """The pad in the axes of the sensor at the start: its x, its y and its origin."""
        there = [a - b for a, b in zip(at, self.at0)]
        return [[dot(axis, v) for axis in self.axes0] for v in (axes[0], axes[1], there)]

    def touch(self, axes, at):
        """The force on each point of the foam that is pressed."""
        (xx, xy, xz), (yx, yy, yz), (ox, oy, oz) = self.local(axes, at)
        depth, near = self.scene.depth, 0.75 * PITCH
        force = fx = fy = stiffness = 0.0
        self.points = []
        part = FOAM / FINE**2
        for i, v in enumerate(self.centres):
            for j, u in enumerate(self.centres):
                if depth(ox + u * xx + v * yx, oy + u * xy + v * yy, oz + u * xz + v * yz) < -near:
                    continue
                for a in range(i * FINE, i * FINE + FINE):
                    y = self.places[a]
                    bx, by, bz = ox + y * yx, oy + y * yy, oz + y * yz
                    for b in range(j * FINE, j * FINE + FINE):
                        x = self.places[b]
                        d = depth(bx + x * xx, by + x * xy, bz + x * xz)
                        if d > 0.0:
                            more = max(0.0, d - FOAM_SOFT)
                            f = part * d + FOAM_CUBIC / FINE**2 * more**3
                            stiffness += part + 3.0 * FOAM_CUBIC / FINE**2 * more**2
                            force += f
                            fx += f * x
                            fy += f * y
                            self.points.append((a, b, f))
        self.force, self.stiffness = force, stiffness
        self.middle = (fx / force, fy / force) if force > 0.0 else None

    def image(self):
        rows = {}
        for a, b, f in self.points:
            row = rows.setdefault(a, [0.0] * COLS)
            for j, share in self.spread[b]:
                row[j] += f * share
        cells = [0.0] * (ROWS * COLS)
        for a, row in rows.items():
            for i, share in self.spread[a]:
                for j in range(COLS):
                    cells[i * COLS + j] += share * row[j]
        common = 1.0 + self.random.gauss(0.0, 0.04)
        noisy = (c / NEWTON * g * common + self.random.gauss(0.0, 0.03) for c, g in zip(cells, self.gains))
        return [max(0, min(4095, round(COUNTS * units))) for units in noisy]

    def step(self, velocity):
        """A frame: the foam is felt once, and as a spring in between."""
        axes, at, _ = forward(self.q)
        self.touch(axes, at)
        height = dot(self.axes0[2], at)
        for _ in range(SUBSTEPS):
            self.substep(velocity, height, DT / SUBSTEPS)

    def substep(self, velocity, height, dt):
        axes, at, joints = forward(self.q)
        torque = [0.0] * 7
        if self.middle:
            x, y = self.middle
            point = [o + x * a + y * b for o, a, b in zip(at, axes[0], axes[1])]
            arms = [cross(axis, [p - o for p, o in zip(point, origin)]) for axis, origin in joints]
            speed = [sum(arm[k] * dq for arm, dq in zip(arms, self.dq)) for k in range(3)]
            into = dot(speed, axes[2])
            force = self.force + self.stiffness * (dot(self.axes0[2], at) - height)
            force = max(0.0, force * (1.0 + FOAM_DAMPING * into / 0.01))
            slide = [s - into * z for s, z in zip(speed, axes[2])]
            drag = FRICTION * force / (math.sqrt(dot(slide, slide)) + CREEP_SPEED)
            push = [-force * z - drag * s for z, s in zip(axes[2], slide)]
            torque = [dot(arm, push) for arm in arms]
        for i in range(7):
            self.q_eq[i] += velocity[i] * dt
            damping = 2.0 * DAMPING_RATIO * math.sqrt(STIFFNESS * INERTIA[i])
            pull = STIFFNESS * (self.q_eq[i] - self.q[i]) - damping * self.dq[i] + torque[i]
            self.dq[i] += pull / INERTIA[i] * dt
            self.q[i] += self.dq[i] * dt

    def off_surface(self, est):
        """How far a reported point is from the object's surface, as the object is without the pad [m]."""
        there = [a - b for a, b in zip(est, self.at0)]
        return abs(self.scene.depth(*(dot(axis, there) for axis in self.axes0)))


def hello(args):
    said = {
        "type": "hello", "proto": 1, "dt": DT, "lockstep": not args.wall, "task": args.scene, "joints": NAMES,
        "q_min": [-q for q in Q_MAX], "q_max": Q_MAX, "dq_max": DQ_MAX, "urdf": "lwr4p", "tip": "lwr_7_link",
        "T_es": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, SENSOR, 0, 0, 0, 1], "rows": ROWS, "cols": COLS, "pitch": PITCH,
        "counts_per_unit": COUNTS, "newton_per_unit": NEWTON, "threshold_units": THRESHOLD, "made_by": ["a", {"test": 1}],
    }
    changes = {
        "hello-proto": ("proto", 2), "hello-nan": ("dq_max", [float("nan")] * 7), "hello-short": ("q_min", [-1.0] * 6),
        "hello-mirror": ("T_es", [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "hello-urdf": ("urdf", "titan"),
        "hello-names": ("joints", NAMES[::-1]), "hello-tip": ("tip", "hand"), "hello-dt": ("dt", 0),
    }
    if args.misbehave in changes:
        key, value = changes[args.misbehave]
        said[key] = value
    if args.misbehave == "hello-missing":
        del said["pitch"]
    return said


class Link:
    """The line to the graph, and what it said."""

    def __init__(self, connection):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.connection, self.buffer, self.closed, self.end = connection, b"", False, None
        self.commands, self.dq, self.est, self.seqs, self.step, self.reports = 0, [0.0] * 7, None, [], 0.0, 0

    def say(self, message):
        data = message if isinstance(message, bytes) else json.dumps(message).encode() + b"\n"
        try:
            self.connection.sendall(data)
        except OSError:
            # What the graph said before it closed the line counts.
            while self.hear(0.0) is not None:
                pass
            self.closed = True

    def hear(self, wait):
        """The next message, if one comes within `wait` seconds."""
        until = time.monotonic() + wait
        while b"\n" not in self.buffer:
            left = until - time.monotonic()
            if self.closed or left < 0 or not select.select([self.connection], [], [], left)[0]:
                return None
            try:
                data = self.connection.recv(65536)
            except OSError:
                data = b""
            self.closed = not data
            self.buffer += data
        line, self.buffer = self.buffer.split(b"\n", 1)
        return self.take(json.loads(line))

    def take(self, message):
        if message["type"] == "end":
            self.end = message["reason"]
        else:
            assert message["type"] == "cmd" and len(message["dq"]) == 7, message
            assert all(math.isfinite(dq) for dq in message["dq"]), message
            assert message["est"] is None or len(message["est"]) == 3, message
            self.step = max(self.step, max(abs(a - b) for a, b in zip(self.dq, message["dq"])))
            self.commands, self.dq, self.est = self.commands + 1, message["dq"], message["est"]
            self.reports += self.est is not None
            self.seqs = self.seqs[-4:] + [message["seq"]]
        return message


def spoilt(kind, obs):
    """What is sent in the place of a frame."""
    if kind == "nan":
        obs["img"][7] = float("nan")
    elif kind == "inf":
        obs["q"][2] = float("inf")
    elif kind == "null":
        obs["dq"][0] = None
    elif kind == "short":
        obs["img"].pop()
    elif kind == "missing":
        del obs["q_eq"]
    elif kind == "back-t":
        obs["t"] -= 1.0
    elif kind == "back-seq":
        obs["seq"] -= 1
    elif kind == "type":
        obs["type"] = "picture"
    elif kind == "garbage":
        return b"\x00\xff what is this?\n"
    elif kind == "words":
        return b"ready when you are\n"
    elif kind == "long":
        return b'{"type":"obs","seq":' + b" " * (1 << 20) + b"1}\n"
    elif kind == "partial":
        return json.dumps(obs).encode()[:100]
    return obs


def serve(link, args, world):
    """Frame after frame, until somebody ends it."""
    if args.misbehave in ("hello-silent", "hello-close", "hello-garbage"):
        if args.misbehave == "hello-silent":
            time.sleep(args.silence)
        if args.misbehave == "hello-garbage":
            link.say(b"220 mail.example ESMTP\r\n")
        return {}
    link.say(hello(args))
    seen = {"found": None, "lost": 0, "time": 0.0, "most": 0.0, "force": [], "x": [], "y": [], "off": []}
    begin, heard, seq = time.monotonic(), time.monotonic(), args.first
    for frame in range(round(args.seconds / DT)):
        t = args.clock + frame * DT
        obs = {"type": "obs", "seq": seq, "t": t, "q": world.q[:], "dq": world.dq[:], "q_eq": world.q_eq[:], "img": world.image()}
        if frame == args.at:
            if args.misbehave == "close":
                return seen
            if args.misbehave == "silent":
                break
            obs = spoilt(args.misbehave, obs)
        seq += 2 if frame == args.at and args.misbehave == "gap" else 1
        link.say(obs)
        if frame == args.at and args.misbehave == "partial":
            return seen
        if args.wall:
            due = begin + (frame + 1) * DT
            while link.end is None and not link.closed and link.hear(max(0.0, due - time.monotonic())):
                heard = time.monotonic()
            if time.monotonic() - heard > 0.1:
                link.dq = [0.0] * 7
        elif link.end is None:
            link.hear(30.0)
        if link.end is not None or link.closed:
            return seen
        world.step(link.dq)
        watch(world, link, seen, frame)
    if args.misbehave == "silent":
        while link.hear(args.silence) and link.end is None:
            pass
        return seen
    link.say({"type": "end"})
    while link.hear(1.0):
        pass
    return seen


def watch(world, link, seen, frame):
    is_touched = world.force > 0.05
    if is_touched and seen["found"] is None:
        seen["found"] = frame * DT
    seen["lost"] += seen["found"] is not None and not is_touched
    seen["time"], seen["most"] = frame * DT, max(seen["most"], world.force)
    last = [("force", world.force)]
    if world.middle:
        last += [("x", world.middle[0] / PITCH), ("y", world.middle[1] / PITCH)]
    if link.est is not None:
        last.append(("off", world.off_surface(link.est)))
    for name, value in last:
        seen[name] = seen[name][-124:] + [value]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--scene", default="ball", choices=["none", "plane", "ball", "pen", "edge", "cable"])
    parser.add_argument("--offset", type=float, nargs=2, default=[0.0, 0.0], help="of the object along the sensor's x and y [m]")
    parser.add_argument("--gap", type=float, default=0.006, help="from the pad to the object at the start [m]")
    parser.add_argument("--radius", type=float, default=0.03, help="of ball, pen or cable [m]")
    parser.add_argument("--angle", type=float, default=0.0, help="of pen, edge or cable from the sensor's x [rad]")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--wall", action="store_true", help="run on the wall clock, and wait for nobody")
    parser.add_argument("--misbehave", default="")
    parser.add_argument("--at", type=int, default=100, help="the frame in which it misbehaves")
    parser.add_argument("--silence", type=float, default=3.0, help="how long it stays when it is silent [s]")
    parser.add_argument("--first", type=int, default=1, help="number of the first frame")
    parser.add_argument("--clock", type=float, default=0.0, help="time of the first frame [s]")
    parser.add_argument("--again", action="store_true", help="take one connection after the other; the arm stays where it is")
    args = parser.parse_args()
    world = World(args)
    with socket.create_server(("127.0.0.1", args.port)) as server:
        server.settimeout(60.0)
        print(server.getsockname()[1], flush=True)
        connection, _ = server.accept()
        while args.again:
            session(connection, args, world)
            connection, _ = server.accept()
    session(connection, args, world)


def session(connection, args, world):
    """One connection, from the hello message to the end."""
    connection.settimeout(60.0)
    with connection:
        link = Link(connection)
        seen = serve(link, args, world)
    summary = {key: value for key, value in seen.items() if not isinstance(value, list)}
    for name in ("force", "x", "y", "off"):
        values = seen.get(name)
        summary[name] = sum(values) / len(values) if values else None
    summary.update(commands=link.commands, reports=link.reports, last_dq=max(map(abs, link.dq)), step=link.step, seqs=link.seqs)
    summary.update(end=link.end, q_eq_moved=max(abs(a - b) for a, b in zip(world.q_eq, START)))
    print(json.dumps(summary), flush=True)


if __name__ == "__main__":
    sys.exit(main())
