"""Loads an exported archive with numpy, and compares it with the CSV file of the same run."""

import csv
import json
import sys

# Another script here has the name of a module that numpy imports.
sys.path.pop(0)

import numpy  # noqa: E402


def main(path, table):
    arrays = numpy.load(path)
    about = json.loads(str(arrays["about"]))
    with open(table, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    header = rows.pop(0)
    for i, name in enumerate(header):
        expected = numpy.array([float(row[i]) if row[i] else numpy.nan for row in rows])
        assert numpy.array_equal(arrays[name], expected, equal_nan=True), name
        assert name in about["units"], name
    images = [name for name in arrays.files if arrays[name].ndim == 3]
    assert images, arrays.files
    for name in images:
        assert arrays[name].shape[0] == len(rows) and arrays[name].dtype == numpy.float32, name
        assert name in about["units"], name
        assert numpy.isfinite(arrays[name][-1]).all() and numpy.nanmax(arrays[name]) > 0, name
    assert about["modes"][""], about
    print(f"{len(rows)} ticks, {len(header)} columns, {len(images)} images")


main(*sys.argv[1:])
