"""A second simulator for the lockstep bridge, with another robot, another pad and other physics than `simulator.py`.

A gantry of three slides and a wrist carries a pad of 10 by 12 tactels of 4 mm, which points down and is turned in the
plane. Its joints have no inertia: each is a spring toward its equilibrium and a damper. The pad is a layer of springs
whose neighbours share their load. It listens, prints its port, serves one graph and prints what it saw as JSON.

    python3 gantry.py --scene ball --offset 0.006 -0.004 --seconds 5 --port 7777
"""

import argparse
import json
import math
import random
import socket
import sys

DT, SUBSTEPS = 0.008, 2
ROWS, COLS, PITCH = 10, 12, 0.004
NEWTON, COUNTS, THRESHOLD = 0.05, 180.0, 0.2
LAYER, SHARE, FRICTION = 150.0, 0.15, 0.2
NAMES = ["slide_x", "slide_y", "slide_z", "roll", "pitch", "yaw"]
LIMIT, SPEED = [0.4] * 3 + [2.9] * 3, [0.5] * 3 + [2.0] * 3
START = [0.12, -0.07, 0.05, 0.1, -0.05, 0.4]
# As in the robot file of the gantry [N/m, N m/rad]. With slides of 15000 N/m the pressure of `hybrid` oscillates.
STIFFNESS = [2000.0] * 6
LAG = 0.03  # of each joint without a load [s]
# The sensor on the hand: below it, aside, and turned by 30 degrees in the plane. Its z points away from the gantry.
SINE, COSINE = math.sin(math.pi / 6), math.cos(math.pi / 6)
MOUNT = [[COSINE, SINE, 0.0], [SINE, -COSINE, 0.0], [0.0, 0.0, -1.0]]
OFFSET = [0.02, -0.01, -0.06]


def apply(rows, v):
    return [sum(a * b for a, b in zip(row, v)) for row in rows]


def product(a, b):
    return [[sum(row[k] * b[k][j] for k in range(3)) for j in range(3)] for row in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def forward(q):
    """Rotation and place of the sensor, place of the wrist, and the axes of its three joints."""
    (sr, cr), (sp, cp), (sy, cy) = [(math.sin(angle), math.cos(angle)) for angle in q[3:]]
    roll = [[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]]
    tilt = product(roll, [[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    hand = product(tilt, [[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    axes = [[1.0, 0.0, 0.0], [row[1] for row in roll], [row[2] for row in tilt]]
    return product(hand, MOUNT), [a + b for a, b in zip(q[:3], apply(hand, OFFSET))], axes


class Scene:
    """An object in the axes of the sensor at the start: how deep a point is in it [m]."""

    def __init__(self, args):
        (self.x, self.y), self.gap, self.radius, self.half = args.offset, args.gap, args.radius, args.length / 2
        self.sin, self.cos = math.sin(args.angle), math.cos(args.angle)
        self.depth = {"plane": self.plane, "ball": self.ball, "edge": self.edge, "rod": self.rod, "ridge": self.ridge}[args.scene]

    def plane(self, _x, _y, z):
        return z - self.gap

    def ball(self, x, y, z):
        return self.radius - math.sqrt((x - self.x) ** 2 + (y - self.y) ** 2 + (z - self.gap - self.radius) ** 2)

    def edge(self, x, y, z):
        return min(z - self.gap, (y - self.y) * self.cos - (x - self.x) * self.sin)

    def rod(self, x, y, z):
        x, y, z = x - self.x, y - self.y, z - self.gap - self.radius
        beyond = max(0.0, abs(x * self.cos + y * self.sin) - self.half)
        across = y * self.cos - x * self.sin
        return self.radius - math.sqrt(beyond * beyond + across * across + z * z)

    def ridge(self, x, y, z):
        """A rod on a plane that bears half of it."""
        return max(self.rod(x, y, z), z - self.gap - self.radius)


class World:
    def __init__(self, args):
        self.scene, self.random = Scene(args), random.Random(args.seed)
        self.q, self.q_eq = START[:], START[:]
        self.rotation0, self.at0, _ = forward(START)
        self.centres = [((i + 0.5 - ROWS / 2) * PITCH, (j + 0.5 - COLS / 2) * PITCH) for i in range(ROWS) for j in range(COLS)]
        self.cells, self.force, self.middle = [0.0] * (ROWS * COLS), 0.0, None

    def to_start(self, v):
        return [sum(self.rotation0[k][i] * v[k] for k in range(3)) for i in range(3)]

    def touch(self, rotation, at):
        """The force of each tactel, a mean of four points, and the middle of all."""
        ux, uy = (self.to_start([row[i] for row in rotation]) for i in (0, 1))
        o = self.to_start([a - b for a, b in zip(at, self.at0)])
        depth, quarter, far = self.scene.depth, PITCH / 4, -0.75 * PITCH
        self.cells, self.force, sx, sy = [0.0] * (ROWS * COLS), 0.0, 0.0, 0.0
        for n, (y, x) in enumerate(self.centres):
            px, py, pz = (o[k] + x * ux[k] + y * uy[k] for k in range(3))
            if depth(px, py, pz) < far:
                continue
            total = 0.0
            for a in (-quarter, quarter):
                for b in (-quarter, quarter):
                    total += max(0.0, depth(px + a * ux[0] + b * uy[0], py + a * ux[1] + b * uy[1], pz + a * ux[2] + b * uy[2]))
            force = LAYER * total / 4
            self.cells[n], self.force, sx, sy = force, self.force + force, sx + force * x, sy + force * y
        self.middle = (sx / self.force, sy / self.force) if self.force > 0.0 else None

    def shared(self):
        """The force of each tactel, after neighbours in a row and then in a column have shared their load."""
        cells = self.cells
        if self.middle:
            for step, count, at in ((1, COLS, lambda n: n % COLS), (COLS, ROWS, lambda n: n // COLS)):
                before = cells
                cells = [
                    (1.0 - 2.0 * SHARE) * f
                    + SHARE * ((before[n - step] if at(n) else 0.0) + (before[n + step] if at(n) < count - 1 else 0.0))
                    for n, f in enumerate(before)
                ]
        return cells

    def image(self):
        common = 1.0 + self.random.gauss(0.0, 0.02)
        return [max(0, round(COUNTS * (f / NEWTON * common + self.random.gauss(0.0, 0.02)))) for f in self.shared()]

    def step(self, velocity):
        dt = DT / SUBSTEPS
        for _ in range(SUBSTEPS):
            rotation, at, axes = forward(self.q)
            self.touch(rotation, at)
            load = [0.0] * 6
            if self.middle:
                x, y, z = ([row[i] for row in rotation] for i in range(3))
                arm = [a + self.middle[0] * b + self.middle[1] * c - d for a, b, c, d in zip(at, x, y, self.q[:3])]
                slide = [v - dot(velocity[:3], z) * n for v, n in zip(velocity[:3], z)]
                drag = FRICTION * self.force / (math.sqrt(dot(slide, slide)) + 0.002)
                push = [-self.force * n - drag * s for n, s in zip(z, slide)]
                load = push + [dot(axis, cross(arm, push)) for axis in axes]
            for i in range(6):
                self.q_eq[i] += velocity[i] * dt
                self.q[i] += (self.q_eq[i] - self.q[i] + load[i] / STIFFNESS[i]) / LAG * dt


def hello(args):
    matrix = [x for row, shift in zip(MOUNT, OFFSET) for x in [*row, shift]] + [0.0, 0.0, 0.0, 1.0]
    return {
        "type": "hello", "proto": 1, "dt": DT, "lockstep": True, "task": args.scene, "joints": NAMES,
        "q_min": [-q for q in LIMIT], "q_max": LIMIT, "dq_max": SPEED, "urdf": "gantry", "tip": "hand", "T_es": matrix,
        "rows": ROWS, "cols": COLS, "pitch": PITCH, "counts_per_unit": COUNTS, "newton_per_unit": NEWTON,
        "threshold_units": THRESHOLD,
    }


def serve(lines, args, world):
    """Frame after frame, until somebody ends it. Returns what was seen."""
    def say(message):
        lines.write(json.dumps(message).encode() + b"\n")
        lines.flush()

    seen = {"frames": 0, "reports": 0, "lost": 0, "touched": 0, "most": 0.0, "end": None}
    say(hello(args))
    for frame in range(round(args.seconds / DT)):
        before = world.q[:]
        say({"type": "obs", "seq": frame, "t": frame * DT, "q": before, "dq": [0.0] * 6, "q_eq": world.q_eq, "img": world.image()})
        line = lines.readline()
        answer = json.loads(line) if line else {"type": "end", "reason": None}
        if answer["type"] == "end":
            seen["end"] = answer["reason"]
            break
        assert answer["seq"] == frame and all(abs(v) <= most for v, most in zip(answer["dq"], SPEED)), answer
        world.step(answer["dq"])
        is_touched = world.force > 4 * THRESHOLD * NEWTON
        seen["frames"], seen["reports"] = frame + 1, seen["reports"] + (answer["est"] is not None)
        seen["touched"] += is_touched
        seen["lost"] += seen["touched"] > 0 and not is_touched
        seen["most"] = max(seen["most"], world.force)
    else:
        say({"type": "end"})
    counted = [f for f in world.shared() if f > THRESHOLD * NEWTON]
    there = world.to_start([a - b for a, b in zip(forward(world.q)[1], world.at0)])
    seen.update(force=world.force, pressure=sum(counted) / len(counted) / NEWTON if counted else None, moved=there)
    along = world.to_start([row[0] for row in forward(world.q)[0]])
    seen.update(across=abs(along[0] * world.scene.cos + along[1] * world.scene.sin))
    seen.update(x=world.middle and world.middle[0], y=world.middle and world.middle[1])
    return seen


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--scene", default="ball", choices=["plane", "ball", "edge", "rod", "ridge"])
    parser.add_argument("--offset", type=float, nargs=2, default=[0.0, 0.0], help="of the object along the sensor's x and y [m]")
    parser.add_argument("--gap", type=float, default=0.004, help="from the pad to the object at the start [m]")
    parser.add_argument("--radius", type=float, default=0.03, help="of ball, rod or ridge [m]")
    parser.add_argument("--length", type=float, default=0.2, help="of rod or ridge [m]")
    parser.add_argument("--angle", type=float, default=0.0, help="of edge, rod or ridge from the sensor's x [rad]")
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    world = World(args)
    with socket.create_server(("127.0.0.1", args.port)) as server:
        server.settimeout(60.0)
        print(server.getsockname()[1], flush=True)
        connection, _ = server.accept()
    connection.settimeout(60.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with connection, connection.makefile("rwb") as lines:
        seen = serve(lines, args, world)
    print(json.dumps(seen), flush=True)


if __name__ == "__main__":
    sys.exit(main())
