"""Reads the points that `--points` wrote, as somebody would who has never seen tactflow, and holds them against the rows
that `--out` wrote of the same run: with the standard library alone.

Arguments: the .ply, the .csv, the column that a pose's columns begin with, and columns beside it, each as `name=column`.
"""

import csv
import math
import struct
import sys


def of_ply(path):
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode("ascii").splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"], lines
    names, count = [], None
    for line in lines[2:]:
        word, *rest = line.split(" ")
        if word == "element":
            assert count is None and rest[0] == "vertex", line
            count = int(rest[1])
        elif word == "property":
            assert count is not None and rest[0] == "double" and len(rest) == 2, line
            names.append(rest[1])
        else:
            assert word == "comment", line
    assert len(set(names)) == len(names), names
    size = 8 * len(names)
    assert len(body) == count * size, (len(body), count, size)
    return names, [dict(zip(names, row)) for row in struct.iter_unpack(f"<{len(names)}d", body)]


def same(a, b):
    return math.isnan(a) if b == "" else a == float(b)


ply, table, pose, *beside = sys.argv[1:]
names, points = of_ply(ply)
with open(table, newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
by_time = {float(row["time"]): row for row in rows}
present = sum(row[f"{pose}.x"] != "" for row in rows)
for point in points:
    row = by_time[point["time"]]
    for axis in "xyz":
        assert same(point[axis], row[f"{pose}.{axis}"]), (point, row["time"])
    # The third column of the rotation, from the quaternion, is the sensor's z: the surface looks the other way.
    x, y, z, w = (float(row[f"{pose}.q{part}"]) for part in "xyzw")
    against = (-2 * (x * z + w * y), -2 * (y * z - w * x), -(1 - 2 * (x * x + y * y)))
    for part, expected in zip(("nx", "ny", "nz"), against):
        assert abs(point[part] - expected) < 1e-9, (point, against)
    for name, column in (pair.split("=") for pair in beside):
        assert same(point[name], row[column]), (name, point, row[column])
times = [point["time"] for point in points]
assert all(before < after for before, after in zip(times, times[1:])), "times rise"
print(f"{len(points)} points of {present} rows, {' '.join(names)}")
