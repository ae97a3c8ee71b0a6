"""Loads the vector images of a recording and of its archive with the Python package, Foxglove's library and numpy.

Prints their shapes, their units, and whether both files have the same numbers.
"""

import json
import pathlib
import sys

# Another script here has the name of a module that numpy imports.
sys.path[0] = str(pathlib.Path(__file__).parents[2] / "nodes/python")

import numpy  # noqa: E402
import tactflow  # noqa: E402


def main(path, archive):
    run, arrays = tactflow.open(path), numpy.load(archive)
    shapes, units, same = [], [], []
    for name in ("pad.vectors", "forces.vectors"):
        series, array = run[name], arrays[name]
        shapes.append(series.values.shape)
        units.extend(series.units)
        # In the archive a tick without a vector image is not a number.
        present = numpy.isfinite(array).all(axis=(1, 2, 3))
        same.append(bool(present.sum() == len(series.values) and (array[present] == series.values).all()))
    print(json.dumps({"shapes": shapes, "units": units, "same": all(same)}))


main(*sys.argv[1:])
