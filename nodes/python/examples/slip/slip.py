"""How likely it is that the object slips on the pad: a small network that looks at the last tenth of a second."""

import functools
import os
from collections import deque

import numpy as np
import tactflow
from tactflow import Flag, Image, Mask, Scalar

#: Frames that the network sees: a tenth of a second at 250 frames per second.
FRAMES = 25
#: Where `train.py` writes the weights.
WEIGHTS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "slip.npz")


class Network:
    """Two layers: the hyperbolic tangent, and the logistic function."""

    NAMES = ("first", "first_bias", "last", "last_bias", "scale")

    def __init__(self, weights):
        self.first, self.first_bias, self.last, self.last_bias, self.scale = weights

    @classmethod
    @functools.lru_cache
    def read(cls, path):
        """Reads the weights from a file."""
        with np.load(path) as archive:
            return cls([archive[name] for name in cls.NAMES])

    def write(self, path):
        """Writes the weights into a file."""
        np.savez(path, **{name: np.float32(getattr(self, name)) for name in self.NAMES})

    def inner(self, seen):
        """The first layer."""
        return np.tanh(seen / self.scale @ self.first + self.first_bias)

    def __call__(self, seen):
        """The probability for each row of `seen`."""
        return 1.0 / (1.0 + np.exp(-(self.inner(seen) @ self.last + self.last_bias)))


def moments(cells, x, y):
    """What a frame is to the network: the centre and the width along x and y [mm], and the force [N]."""
    force, columns, rows = cells.sum(), cells.sum(axis=0), cells.sum(axis=1)
    middle_x, middle_y = columns @ x / force, rows @ y / force
    width_x, width_y = np.sqrt([columns @ (x - middle_x) ** 2 / force, rows @ (y - middle_y) ** 2 / force])
    return np.array([1e3 * middle_x, 1e3 * middle_y, 1e3 * width_x, 1e3 * width_y, force])


def differences(frames):
    """What the network sees: how the frames differ from the newest one."""
    frames = np.asarray(frames)
    return (frames[:-1] - frames[-1]).ravel()


last = deque(maxlen=FRAMES)


@tactflow.node
def slip(image: Image["N", "The image of the pad."], region: Mask) -> {
    "probability": Scalar["1", "How likely it is that the object slips."],
    "slips": Flag,
}:
    """Whether the object slips, from the normal forces of the last tenth of a second."""
    if image is None or region is None or not region.any():
        last.clear()
        return {}
    last.append(moments(image.cells * region, image.x, image.y))
    if len(last) < FRAMES:
        return {}
    probability = float(Network.read(WEIGHTS)(differences(last)))
    return {"probability": probability, "slips": probability > 0.5}


if __name__ == "__main__":
    tactflow.main(slip)
