"""Reads a recording of the hybrid task with the Python package, and runs its node alone on it."""

import os
import sys

# A file beside this one has the name of a module of Python.
sys.path.pop(0)

import subprocess
import tempfile

import numpy as np

import tactflow

path = sys.argv[1]
run = tactflow.open(path)
image = run["touch.calibrate.repaired"]
assert image.kind == "image" and image.values.shape[1:] == (16, 16) and image.units == ["N"], image
assert np.all(np.diff(image.times) > 0) and image.times[-1] <= 2.0
there = ~np.isnan(run["touch.moments.x"].values)
assert there.sum() > 20 and run["contact.x"].units == ["m"]
# The answer of the program is that of the node, one tick later.
node = dict(zip(run["touch.moments.x"].times.round(6), run["touch.moments.x"].values))
pairs = [(node[t], x) for t, x in zip((run["contact.x"].times - 0.004).round(6), run["contact.x"].values) if t in node]
pairs = np.array([pair for pair in pairs if not np.isnan(pair).any()])
assert len(pairs) > 20 and np.abs(pairs[:, 0] - pairs[:, 1]).max() < 1e-6, pairs
assert run["error.error"].columns == ["x", "y", "pressure"] and run["error.error"].values.shape[1] == 3
assert run.info["tactflow"]["graph"].endswith("hybrid.toml")

region = run["touch.label.region"].values
with tempfile.TemporaryDirectory() as folder:
    frames = os.path.join(folder, "frames.npz")
    np.savez(frames, image=image.values[-len(region):][-10:], region=region[-10:])
    script = os.path.join(os.path.dirname(os.path.dirname(tactflow.__file__)), "examples", "contact.py")
    alone = subprocess.run([sys.executable, script, "--test", frames], capture_output=True, text=True, check=True)
    lines = alone.stdout.splitlines()
    assert lines[2] == "frame  x [m]        y [m]        pressure [N/tactel]", alone.stdout
    assert len(lines) == 14 and lines[3].startswith("0 ") and lines[-1].startswith("10 frames; "), alone.stdout
