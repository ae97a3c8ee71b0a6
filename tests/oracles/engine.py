"""A simulator for the lockstep bridge whose arm is computed by a physics engine: MuJoCo (`pip install mujoco==4.0.0`).

MuJoCo integrates a KUKA LWR 4+ with the masses of its model, the inertia of its drives, friction in its joints, and
joint impedance. The pad is a foam of 48 by 48 points that stiffens, creeps, and sticks to the object until it slips:
each point has a bristle. It listens, prints its port, serves one graph and prints what it saw.

    python3 engine.py --scene box --offset 0.01 -0.005 --angle 0.4 --seconds 10 --port 7777

An object stands still, or it is moved, turned or made stiffer at times that `--help` names; cells of the pad can fail.
"""

import argparse
import json
import math
import socket
import sys
from pathlib import Path

import mujoco
import numpy as np

DT, SUBSTEPS = 0.004, 4
CELLS, PITCH, FINE = 16, 0.005, 3
NEWTON, COUNTS, THRESHOLD = 0.1, 102.375, 0.15
START = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]
SENSOR = 0.03
NAMES = [f"lwr_{name}_joint" for name in ("a1", "a2", "e1", "a3", "a4", "a5", "a6")]
Q_MAX = [math.radians(degrees) for degrees in (170, 120, 170, 120, 170, 120, 170)]
DQ_MAX = [math.radians(degrees) for degrees in (110, 110, 128, 128, 204, 184, 184)]
MODEL = Path(__file__).resolve().parents[2] / "graphs/robots/lwr4p.urdf"
# Inertia of the drives that remains under torque control [kg m²], and the friction of the joints [N m].
DRIVES = [0.96, 0.92, 0.6, 0.62, 0.24, 0.12, 0.12]
JOINT_FRICTION = 0.1
DAMPING_RATIO = 0.2
# The foam of a tactel [N/m, N/m³], where it stiffens [m], its creep, and the spread of a force over the tactels [m].
FOAM, CUBIC, SOFT, CREEP, CREEP_S, SPREAD = 300.0, 8e7, 0.0025, 0.05, 1.5, 0.003
# Of an edge or a rim at 45 degrees.
TILTED = math.sqrt(0.5)
# Coefficient of friction, and the stiffness of a bristle over that of the foam.
FRICTION, BRISTLES = 0.35, 0.6
# Noise that all tactels of a frame share (of the reading), noise of each tactel [units], spread of the gains.
COMMON, OWN, GAINS = 0.04, 0.03, 0.05


class Scene:
    """An object in the axes of the sensor at the start: how deep points are in it [m]."""

    def __init__(self, args):
        self.radius, self.bend, self.kind = args.radius, args.bend, args.scene
        self.half = np.array([*args.size, 0.04]) / 2
        self.axes = np.array(args.axes)
        # Where it is and where it goes [m], its angle [rad], and how both change now.
        self.place, self.angle = np.array([*args.offset, args.gap]), args.angle
        self.goal, self.speed, self.velocity = self.place.copy(), args.speed, np.zeros(3)
        self.moves = sorted(args.move)
        self.rate, self.turn = math.radians(args.turn), 0.0
        self.turns_from = args.turn_from

    def advance(self, time, dt):
        while self.moves and self.moves[0][0] <= time:
            self.goal = self.goal + self.moves.pop(0)[1:]
        way = self.goal - self.place
        length = np.linalg.norm(way)
        self.velocity = way / max(length / self.speed, dt)
        self.turn = self.rate if time >= self.turns_from else 0.0
        self.place, self.angle = self.place + self.velocity * dt, self.angle + self.turn * dt

    def moves_with(self, x, y):
        """Velocity of the object along the axes at the start, at points of the pad [m/s]."""
        return self.velocity[0] - self.turn * (y - self.place[1]), self.velocity[1] + self.turn * (x - self.place[0])

    def line_at(self, x, y):
        """Place along and across the object [m], and the angle of its line there."""
        x, y = x - self.place[0], y - self.place[1]
        sin, cos = math.sin(self.angle), math.cos(self.angle)
        along, across = x * cos + y * sin, y * cos - x * sin
        if self.kind == "rim":
            # The nearest point of the rim, which the pad sees as an ellipse.
            turned = np.linspace(-1.0, 1.0, 2001)
            way, beside = self.radius * np.sin(turned), self.radius * TILTED * (1.0 - np.cos(turned))
            at = np.argmin((way - along) ** 2 + (beside - across) ** 2)
            angle = self.angle + math.atan2(math.sin(turned[at]) * TILTED, math.cos(turned[at]))
            return way[at], across - beside[at], angle
        if not self.bend:
            return along, across, self.angle
        # An arc: its centre is beside it. Along it is the length of the arc.
        beside = self.bend - across
        turned = np.arctan2(along, beside)
        return self.bend * turned, self.bend - np.hypot(along, beside), self.angle + turned

    def depth(self, points):
        x, y, z = (points[i] - self.place[i] for i in range(3))
        if self.kind in ("ellipsoid", "rim"):
            sin, cos = math.sin(self.angle), math.cos(self.angle)
            x, y = x * cos + y * sin, y * cos - x * sin
            return self.in_ellipsoid(x, y, z) if self.kind == "ellipsoid" else self.in_disc(x, y, z)
        along, across, _ = self.line_at(points[0], points[1])
        if self.kind == "ball":
            return self.radius - np.sqrt(x * x + y * y + (z - self.radius) ** 2)
        if self.kind == "pen":
            beyond = np.maximum(0.0, np.abs(along) - self.half[0])
            # The pad does not leave it on the other side: below its middle it is as wide as there.
            side, down = np.hypot(beyond, across), z - self.radius
            inside = self.radius + np.maximum(down, 0.0) - np.hypot(side, np.minimum(down, 0.0))
            return np.where(side < self.radius, inside, self.radius - np.hypot(side, down))
        if self.kind == "edge":
            return (z - np.abs(across)) * TILTED
        # A box with edges of 2 mm.
        place = np.abs([along, across, z - self.half[2]]) - (self.half[:, None] - 0.002)
        outside = np.sqrt((np.maximum(place, 0.0) ** 2).sum(axis=0))
        return 0.002 - outside - np.minimum(place.max(axis=0), 0.0)

    def in_ellipsoid(self, x, y, z):
        """By the first term of the distance, which is exact at the surface."""
        at = np.stack([x, y, z - self.axes[2]], -1) / self.axes
        size, slope = np.linalg.norm(at, axis=-1), np.linalg.norm(at / self.axes, axis=-1)
        return size * (1.0 - size) / np.maximum(slope, 1e-9)

    def in_disc(self, x, y, z):
        """In a disc that is tilted by 45 degrees and 40 mm thick; its rim has a radius of 1 mm."""
        out, up = TILTED * (y + z) - self.radius, TILTED * (z - y)
        place = np.stack([np.hypot(x, out) - self.radius, np.abs(up - 0.02) - 0.02]) + 0.001
        outside = np.sqrt((np.maximum(place, 0.0) ** 2).sum(axis=0))
        return 0.001 - outside - np.minimum(place.max(axis=0), 0.0)


class Cap:
    """Which points of an ellipsoid the pad has pressed, of those that are inclined by up to 40 degrees."""

    def __init__(self, scene):
        self.scene = scene
        angles = [(tilt, 2.0 * math.pi * i / count) for tilt in np.radians(np.linspace(0.0, 40.0, 30))
                  for count in [max(1, round(60 * math.sin(tilt)))] for i in range(count)]
        normals = np.array([[math.sin(t) * math.cos(a), math.sin(t) * math.sin(a), -math.cos(t)] for t, a in angles])
        self.points = normals * scene.axes**2 / np.linalg.norm(normals * scene.axes, axis=1)[:, None]
        self.points[:, 2] += scene.axes[2]
        self.pressed = np.zeros(len(self.points), bool)

    def see(self, axes, middle):
        """With the pad at this place, in its axes at the start."""
        sin, cos = math.sin(self.scene.angle), math.cos(self.scene.angle)
        points = self.points @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]]) + self.scene.place
        x, y, z = ((points - middle) @ axes).T
        half = CELLS * PITCH / 2
        self.pressed |= (np.abs(x) < half) & (np.abs(y) < half) & (z < 0.0) & (z > -0.01)


class Foam:
    """The points of the pad, and the forces on them."""

    def __init__(self, object_n_per_m):
        self.stiffen(object_n_per_m)
        count = CELLS * FINE
        line = (np.arange(count) + 0.5) / FINE * PITCH - CELLS * PITCH / 2
        self.x, self.y = (grid.ravel() for grid in np.meshgrid(line, line))
        self.centres = (np.arange(CELLS) + 0.5 - CELLS / 2) * PITCH
        below = np.vectorize(lambda x: 0.5 * (1.0 + math.erf(x / SPREAD / math.sqrt(2.0))))
        ends = self.centres[:, None] - line[None, :]
        self.shares = below(ends + PITCH / 2) - below(ends - PITCH / 2)
        self.bristles, self.creep, self.force = np.zeros((2, count**2)), np.zeros(count**2), np.zeros(count**2)

    def stiffen(self, object_n_per_m):
        """The object gives way behind the foam, so the foam stiffens at a larger depth."""
        soft = 1.0 / (1.0 + FOAM / object_n_per_m)
        self.stiffness, self.cubic = FOAM * soft / FINE**2, CUBIC * soft**4 / FINE**2
        self.soft = SOFT / soft

    def press(self, depth, slide, dt):
        """Returns the force and the torque at the middle of the pad, in its axes."""
        pressed = depth > 0.0
        depth = np.maximum(depth, 0.0)
        self.creep += (depth - self.creep) * dt / CREEP_S
        more = np.maximum(depth - self.soft, 0.0)
        force = self.stiffness * (depth - CREEP * self.creep) + self.cubic * more**3
        self.force = np.maximum(force, 0.0) * pressed
        self.bristles = (self.bristles + slide * dt) * pressed
        most = FRICTION * self.force / (BRISTLES * self.stiffness)
        length = np.maximum(np.hypot(*self.bristles), 1e-12)
        self.bristles *= np.minimum(1.0, most / length)
        fx, fy = -BRISTLES * self.stiffness * self.bristles
        force = np.array([fx.sum(), fy.sum(), -self.force.sum()])
        torque = [-(self.force @ self.y), self.force @ self.x, self.x @ fy - self.y @ fx]
        return force, np.array(torque)

    def units(self):
        """What each tactel feels."""
        count = CELLS * FINE
        return self.shares @ self.force.reshape(count, count) @ self.shares.T / NEWTON


class Faults:
    """What is wrong with the pad: tactels that stay at zero or at a reading, and frames that are no measurement."""

    def __init__(self, args):
        # The noise of a pad is the same with and without faults.
        self.random = np.random.default_rng([args.seed, 2])
        cells = self.random.permutation(CELLS**2)
        self.dead, self.stuck = cells[: args.dead], cells[args.dead : args.dead + args.stuck]
        self.garbage, self.repeat, self.last = list(args.garbage), args.repeat, None

    def spoil(self, image, time):
        image.ravel()[self.dead], image.ravel()[self.stuck] = 0, 3000
        if self.garbage and time >= self.garbage[0]:
            self.garbage.pop(0)
            return np.full_like(image, 4095)
        if self.last is not None and self.random.random() < self.repeat:
            return self.last
        self.last = image
        return image


class World:
    def __init__(self, args):
        self.scene, self.foam, self.random = Scene(args), Foam(args.stiffness), np.random.default_rng(args.seed)
        self.time, self.stiffer = 0.0, sorted(args.stiffer)
        self.faults = Faults(args)
        spec = mujoco.MjSpec.from_file(str(MODEL))
        spec.option.timestep, spec.option.integrator = DT / SUBSTEPS, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        # The controller compensates the weight.
        spec.option.gravity = [0.0, 0.0, 0.0]
        for name, inertia in zip(NAMES, DRIVES):
            joint = spec.joint(name)
            joint.armature, joint.frictionloss = inertia, JOINT_FRICTION
        site = spec.body("lwr_7_link").add_site()
        site.name, site.pos = "pad", [0.0, 0.0, SENSOR]
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = START
        mujoco.mj_forward(self.model, self.data)
        self.site, self.body = self.model.site("pad").id, self.model.body("lwr_7_link").id
        inertia = np.zeros((len(NAMES), len(NAMES)))
        mujoco.mj_fullM(self.model, self.data, inertia)
        self.stiffness = args.joints
        self.damping = 2.0 * DAMPING_RATIO * np.sqrt(self.stiffness * np.diag(inertia))
        self.q_eq = np.array(START)
        self.axes0, self.at0 = (value.copy() for value in self.pad())
        self.cap = Cap(self.scene) if args.scene == "ellipsoid" else None
        self.gains = np.exp(self.random.normal(0.0, GAINS, (CELLS, CELLS)))

    def pad(self):
        """Axes and middle of the pad, in the base of the arm."""
        return self.data.site_xmat[self.site].reshape(3, 3), self.data.site_xpos[self.site]

    def placed(self):
        """Axes and middle of the pad, in its axes at the start."""
        axes, at = self.pad()
        return self.axes0.T @ axes, self.axes0.T @ (at - self.at0)

    def line_seen(self):
        """Angle of the object's line from y of the pad [degrees], and how far the middle is beside it [m]."""
        axes, middle = self.placed()
        _, across, angle = self.scene.line_at(middle[0], middle[1])
        turned = math.degrees(angle - math.atan2(axes[1, 0], axes[0, 0]))
        return turned % 180.0 - 90.0, across

    def touch(self, dt):
        axes, at = self.pad()
        local, middle = self.placed()
        points = middle[:, None] + local[:, :1] * self.foam.x + local[:, 1:2] * self.foam.y
        motion = np.zeros(6)
        mujoco.mj_objectVelocity(self.model, self.data, mujoco.mjtObj.mjOBJ_SITE, self.site, motion, 1)
        turn, speed = motion[:3], motion[3:]
        slide = np.array([speed[0] - turn[2] * self.foam.y, speed[1] + turn[2] * self.foam.x])
        slide -= local[:2, :2].T @ np.array(np.broadcast_arrays(*self.scene.moves_with(points[0], points[1])))
        force, torque = self.foam.press(self.scene.depth(points), slide, dt)
        return axes @ force, axes @ torque, at.copy()

    def step(self, velocity):
        dt = DT / SUBSTEPS
        while self.stiffer and self.stiffer[0][0] <= self.time:
            self.foam.stiffen(self.stiffer.pop(0)[1])
        for _ in range(SUBSTEPS):
            self.time += dt
            self.scene.advance(self.time, dt)
            self.q_eq = self.q_eq + np.array(velocity) * dt
            force, torque, at = self.touch(dt)
            applied = self.stiffness * (self.q_eq - self.data.qpos) - self.damping * self.data.qvel
            mujoco.mj_applyFT(self.model, self.data, force, torque, at, self.body, applied)
            self.data.qfrc_applied[:] = applied
            mujoco.mj_step(self.model, self.data)
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            mujoco.mj_comVel(self.model, self.data)
        if self.cap:
            self.cap.see(*self.placed())

    def image(self, units):
        noisy = units * self.gains * (1.0 + self.random.normal(0.0, COMMON)) + self.random.normal(0.0, OWN, units.shape)
        return self.faults.spoil(np.clip(np.round(COUNTS * noisy), 0, 4095), self.time)


def hello(args):
    return {
        "type": "hello", "proto": 1, "dt": DT, "lockstep": True, "task": args.scene, "joints": NAMES,
        "q_min": [-q for q in Q_MAX], "q_max": Q_MAX, "dq_max": DQ_MAX, "urdf": "lwr4p", "tip": "lwr_7_link",
        "T_es": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, SENSOR, 0, 0, 0, 1], "rows": CELLS, "cols": CELLS, "pitch": PITCH,
        "counts_per_unit": COUNTS, "newton_per_unit": NEWTON, "threshold_units": THRESHOLD,
    }


def features(units, centres):
    """Pressure [units] and place [tactels] of what is above the threshold; not a number without a contact."""
    felt = units * (units > THRESHOLD)
    total = felt.sum()
    if total == 0.0:
        return [math.nan] * 3
    return [total / (felt > 0.0).sum(), felt.sum(0) @ centres / total / PITCH, felt.sum(1) @ centres / total / PITCH]


def response(times, values, target, within):
    """Time until the values stay within a distance for 0.3 s."""
    stay = round(0.3 / DT)
    near = np.convolve(np.abs(np.nan_to_num(values, nan=1e9) - target) <= within, np.ones(stay), "valid") >= stay
    return float(times[near.argmax()] - times[0]) if near.any() else None


def number(value):
    return float(value) if math.isfinite(value) else None


def seen(rows, change):
    """What a run shows from its first touch on.

    With a change that begins and ends, `before` is the mean force [N] in the second before it, and `after` are the
    figures from its end on, with their times from there.
    """
    rows = np.array(rows)
    touched = rows[:, 1] > 0.05
    if not touched.any():
        return {"touched": None}
    rows = rows[touched.argmax():]
    if change is None:
        return figures(rows)
    begin, end = np.searchsorted(rows[:, 0], change)
    before, after = rows[max(0, begin - round(1.0 / DT)) : begin, 1], rows[end:]
    return {**figures(rows), "before": number(before.mean()) if len(before) else None,
            "after": figures(after) if len(after) else None}


def figures(rows):
    """Times [s], forces [N], pressures [units] and places [tactels].

    `lost` counts the frames without a contact, but not the first 25, and `found_again` the contacts after them. `error`
    and `deviation` are of what the pad says in the last 5 s, and `true_error` is of the truth. `line` has the mean and
    the deviation of the angle between the object's line and y of the pad [degrees], and the deviation of its distance
    [mm].
    """
    times, force, pressure, x, y, felt, felt_x, felt_y, angle, across = rows.T
    last = slice(-round(5.0 / DT), None)
    mean = np.convolve(felt, np.ones(10) / 10, "valid")
    truth = ((pressure, 1.0), (x, 0.0), (y, 0.0))
    found = np.diff((force[25:] >= 0.02).astype(int)) == 1
    return {
        "touched": float(times[0]), "lost": int((force[25:] < 0.02).sum()), "most": float(force.max()),
        "found_again": int(found.sum()),
        "response": {name: response(times, values, target, within) for name, (values, target), within in
                     zip(("pressure", "x", "y"), truth, (0.12, 0.3, 0.3))},
        "error": [number(np.mean(felt[last]) - 1.0), number(np.mean(felt_x[last])), number(np.mean(felt_y[last]))],
        "deviation": [number(np.std(values[last])) for values in (felt, felt_x, felt_y)],
        "mean_deviation": number(np.std(mean[last])),
        "line": [number(value) for value in (np.mean(angle[last]), np.std(angle[last]), 1e3 * np.std(across[last]))],
        "true_error": [number(np.mean(values[last]) - target) for values, target in truth],
        "true_rms": number(np.sqrt(np.mean((pressure[last] - 1.0) ** 2))),
    }


def serve(lines, args, world):
    """Frame after frame, until somebody ends it. Returns what was seen."""
    def say(message):
        lines.write(json.dumps(message).encode() + b"\n")
        lines.flush()

    say(hello(args))
    rows, end = [], None
    for frame in range(round(args.seconds / DT)):
        units = world.foam.units()
        image = world.image(units)
        truth, felt = features(units, world.foam.centres), features(image / COUNTS, world.foam.centres)
        rows.append([frame * DT, units.sum() * NEWTON, *truth, *felt, *world.line_seen()])
        q, dq = world.data.qpos.tolist(), world.data.qvel.tolist()
        try:
            say({"type": "obs", "seq": frame, "t": frame * DT, "q": q, "dq": dq, "q_eq": world.q_eq.tolist(),
                 "img": image.ravel().tolist()})
            line = lines.readline()
        except OSError:
            line = b""
        answer = json.loads(line) if line else {"type": "end", "reason": None}
        if answer["type"] == "end":
            end = answer["reason"]
            break
        world.step(answer["dq"])
    else:
        say({"type": "end"})
    said = {"frames": len(rows), "end": end, **seen(rows, args.change)}
    # The part of the cap that the pad has not pressed [%].
    return {**said, "missed": 100.0 * float(1.0 - world.cap.pressed.mean())} if world.cap else said


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--scene", default="ball", choices=["ball", "pen", "box", "edge", "rim", "ellipsoid"])
    parser.add_argument("--offset", type=float, nargs=2, default=[0.0, 0.0], help="along the sensor's x and y [m]")
    parser.add_argument("--gap", type=float, default=0.006, help="from the pad to the object at the start [m]")
    parser.add_argument("--radius", type=float, default=0.04, help="of ball, pen or rim [m]")
    parser.add_argument("--size", type=float, nargs=2, default=[0.04, 0.03], help="of the box, along its axes [m]")
    parser.add_argument("--axes", type=float, nargs=3, default=[0.07, 0.11, 0.05],
                        help="half axes of the ellipsoid [m]")
    parser.add_argument("--angle", type=float, default=0.0, help="from the sensor's x [rad]")
    parser.add_argument("--bend", type=float, default=0.0, help="radius of the arc of a pen; 0 is straight [m]")
    parser.add_argument("--move", type=float, nargs=4, default=[], action="append", metavar=("T", "X", "Y", "Z"),
                        help="at a time [s], along the sensor's axes at the start [m]")
    parser.add_argument("--speed", type=float, default=0.5, help="of the moves [m/s]")
    parser.add_argument("--turn", type=float, default=0.0, help="rate of its angle [degrees/s]")
    parser.add_argument("--turn-from", type=float, default=0.0, help="when it begins to turn [s]")
    parser.add_argument("--stiffer", type=float, nargs=2, default=[], action="append", metavar=("T", "N_PER_M"),
                        help="at a time [s], another stiffness of the object")
    parser.add_argument("--dead", type=int, default=0, help="tactels that read zero")
    parser.add_argument("--stuck", type=int, default=0, help="tactels that always read the same")
    parser.add_argument("--repeat", type=float, default=0.0, help="share of frames that repeat the one before")
    parser.add_argument("--garbage", type=float, default=[], action="append", help="time of a frame at its maximum [s]")
    parser.add_argument("--change", type=float, nargs=2, help="when what is changed begins and ends [s]")
    parser.add_argument("--joints", type=float, default=200.0, help="stiffness of the arm's joints [N m/rad]")
    parser.add_argument("--stiffness", type=float, default=1e6, help="of the object behind a tactel [N/m]")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="start again after each run, until it is stopped")
    args = parser.parse_args()
    with socket.create_server(("127.0.0.1", args.port)) as server:
        server.settimeout(60.0)
        print(server.getsockname()[1], flush=True)
        run(server, args)
        while args.again:
            run(server, args)


def run(server, args):
    """One run, with a world of its own."""
    world = World(args)
    connection, _ = server.accept()
    connection.settimeout(60.0)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    with connection, connection.makefile("rwb") as lines:
        said = serve(lines, args, world)
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    sys.exit(main())
