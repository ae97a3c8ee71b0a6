"""A pad driver: a simulated pad of 8 by 8 tactels whose contact wanders. Replace `frames` by your sensor."""

import time

import numpy as np

import tactflow

ROWS, COLS, PITCH = 8, 8, 0.004


def frames():
    """Yields the time of each frame in the sensor's clock [ns], and its values [N]."""
    i, j = np.mgrid[0:ROWS, 0:COLS]
    while True:
        now = time.monotonic_ns()
        at = 3.5 + 1.5 * np.sin(now * 1e-9)
        yield now, 0.5 * np.exp(-((i - 3.5) ** 2 + (j - at) ** 2)).astype(np.float32)
        time.sleep(0.01)


if __name__ == "__main__":
    tactflow.pad(frames(), "wave_pad", unit="N", rows=ROWS, cols=COLS, pitch=(PITCH, PITCH))
