"""Trains the network of `slip.py` on simulated contacts, and prints how often it is right on others.

    python3 train.py

In each run the arm holds a force on a ball or a pen. The object is drawn along the pad at different speeds, rests, is
pushed against the pad, and shakes so little that the foam only shears. The simulation knows the force of friction, and
so it knows when the object slips. It takes a minute, and needs the packages tactflow and mcap.
"""

import argparse
import os
import subprocess
import tempfile

import numpy as np
import tactflow

from slip import FRAMES, WEIGHTS, Network, differences, moments

HERE = os.path.dirname(os.path.abspath(__file__))
GRAPHS = os.path.join(HERE, "../../../../graphs")
#: Duration of a run, and from when on the object moves [s].
DURATION, BEGIN = 30.0, 4.0
#: Coefficient of sliding friction of the simulated foam [1], and the slowest motion that counts as slip [m/s].
SLIDING, SLOWEST = 0.3, 0.002

BENCH = """[bind]
pad = "bench"
arm = "bench"
truth = "bench"

[devices.bench]
type = "sim_bench"
for_s = {duration}
seed = {seed}
calibration = "{graphs}/calibrations/sim_pad.toml"
robot = "{graphs}/robots/lwr4p.toml"
mount = {{ xyz = [0.0, 0.0, 0.03] }}
objects = [{{ {shape}, at = [0.0, 0.0, {height}], stiffness = {stiffness}, motion = [{motions}] }}]

[limits]
workspace_min_m = [-0.8, -0.4, 0.1]
workspace_max_m = [-0.3, 0.4, 0.7]
"""


def motions(random):
    """Draws motions of the object: begin and end [s], and displacement in the sensor's frame [m]."""
    drawn, now, place = [], BEGIN, np.zeros(2)
    while now < DURATION - 3.0:
        kind = random.choice(["slide", "shake", "push"], p=[0.6, 0.2, 0.2])
        if kind == "slide":
            along = random.uniform(-0.012, 0.012, 2) - place
            lasts = np.linalg.norm(along) / random.uniform(0.003, 0.03)
        elif kind == "shake":
            along, lasts = random.uniform(-1e-4, 1e-4, 2), 0.1
        else:
            along, lasts = np.zeros(2), random.uniform(0.1, 0.5)
        place = place + along
        into = random.choice([-1e-3, 1e-3]) if kind == "push" else 0.0
        drawn.append((now, now + max(lasts, 0.05), np.append(along, into)))
        now = drawn[-1][1] + random.uniform(0.2, 0.8)
    return drawn


def bench(random, drawn):
    """Writes a bench with an object that moves so."""
    is_ball = random.random() < 0.7
    radius = random.uniform(0.015, 0.06) if is_ball else 0.006
    shape = f'shape = "ball", radius = {radius}' if is_ball else f'shape = "pen", length = 0.03, radius = {radius}'
    rows = [
        f"{{ from_s = {begin}, to_s = {end}, steady = true, by = {list(map(float, by))} }}" for begin, end, by in drawn
    ]
    return BENCH.format(
        duration=DURATION,
        seed=random.integers(1, 1 << 31),
        graphs=GRAPHS,
        shape=shape,
        height=radius + 0.006,
        stiffness=random.uniform(100.0, 400.0),
        motions=", ".join(rows),
    )


def record(tool, text):
    """Runs the task on a bench, and reads its recording."""
    with tempfile.TemporaryDirectory() as folder:
        path, recording = os.path.join(folder, "bench.toml"), os.path.join(folder, "run.mcap")
        with open(path, "w") as file:
            file.write(text)
        task = os.path.join(HERE, "press.toml")
        subprocess.run([tool, "run", "--quiet", task, "--bench", path, "--record", recording], check=True)
        return tactflow.open(recording)


def contact(tool, seed):
    """Records one contact. Returns what the network sees at each time, and whether the object slips."""
    random = np.random.default_rng(seed)
    drawn = motions(random)
    run = record(tool, bench(random, drawn))
    image = run["touch.calibrate.repaired"]
    names = "touch.label.region", "truth.force", "truth.tangential"
    region, force, friction = (dict(zip(run[name].times, run[name].values)) for name in names)
    x, y = (
        (np.arange(count) - (count - 1) / 2) * pitch for count, pitch in zip(image.values.shape[:0:-1], image.pitch)
    )
    seen, slips, last = [], [], []
    for now, cells in zip(image.times, image.values):
        if now not in region or not region[now].any():
            last = []
            continue
        last = [*last, moments(cells * region[now], x, y)][-FRAMES:]
        if len(last) < FRAMES or now < BEGIN - 1.0:
            continue
        moves = (np.linalg.norm(by[:2]) / (end - begin) for begin, end, by in drawn if begin <= now < end)
        speed = max(moves, default=0.0)
        seen.append(differences(last))
        slips.append(speed > SLOWEST and friction[now] > 0.95 * SLIDING * force[now])
    return np.array(seen), np.array(slips)


def contacts(tool, seeds):
    """Records several contacts."""
    seen, slips = zip(*(contact(tool, seed) for seed in seeds))
    return np.concatenate(seen), np.concatenate(slips)


def trained(seen, slips, random, hidden=16, rounds=30, batch=256, rate=2e-3):
    """Fits a network to the cross entropy by stochastic gradients (Adam: Kingma and Ba, ICLR 2015)."""
    inputs = seen.shape[1]
    first, last = random.normal(0.0, inputs**-0.5, (inputs, hidden)), random.normal(0.0, hidden**-0.5, hidden)
    weights = [first, np.zeros(hidden), last, np.zeros(()), seen.std(axis=0)]
    network = Network(weights)
    means, squares = ([np.zeros_like(one) for one in weights[:4]] for _ in range(2))
    steps = 0
    for _ in range(rounds):
        for chosen in np.array_split(random.permutation(len(seen)), len(seen) // batch):
            steps += 1
            gradients = gradients_of(network, seen[chosen], slips[chosen])
            for one, gradient, mean, square in zip(weights, gradients, means, squares):
                mean += 0.1 * (gradient - mean)
                square += 0.001 * (gradient**2 - square)
                one -= rate * mean / (1 - 0.9**steps) / (np.sqrt(square / (1 - 0.999**steps)) + 1e-8)
    return network


def gradients_of(network, seen, slips):
    """Returns the gradients of the mean cross entropy, for the weights and the offsets of both layers."""
    inner = network.inner(seen)
    error = (network(seen) - slips) / len(seen)
    back = np.outer(error, network.last) * (1.0 - inner**2)
    return [(seen / network.scale).T @ back, back.sum(axis=0), inner.T @ error, error.sum()]


def main():
    """Trains on 15 contacts, tests with 5 others, and writes the weights."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tactflow", default="tactflow", help="the tool that runs the contacts")
    parser.add_argument("--out", default=WEIGHTS, help="file of the weights")
    arguments = parser.parse_args()
    seen, slips = contacts(arguments.tactflow, range(15))
    network = trained(seen, slips, np.random.default_rng(0))
    unseen, truth = contacts(arguments.tactflow, range(1000, 1005))
    said = network(unseen) > 0.5
    print(f"{len(seen)} frames for the training, {len(unseen)} others for the test, with slip in {truth.mean():.0%}")
    print(f"right: {(said == truth).mean():.1%}; slip that is found: {said[truth].mean():.1%}; ", end="")
    print(f"false alarms: {said[~truth].mean():.1%} of the frames without slip")
    network.write(arguments.out)


if __name__ == "__main__":
    main()
