"""Reads a calibration file with the standard library alone and turns readings into forces, as its own text says.

Takes the file and a reading; prints the force of each tactel, row after row, for that reading of all.
"""

import sys
import tomllib

path, reading = sys.argv[1], float(sys.argv[2])
with open(path, "rb") as file:
    pad = tomllib.load(file)
assert (pad["kind"], pad["version"]) == ("calibration", 1), pad


def force(tactel):
    s = reading - tactel["offset"]
    if pad["curve"] == "linear":
        return tactel["gain"] * s
    if pad["curve"] == "rational":
        end = tactel["most"] / (tactel["gain"] + tactel["squash"] * tactel["most"])
        s = min(max(s, 0.0), end)
        return tactel["gain"] * s / (1.0 - tactel["squash"] * s)
    knots = [(0.0, 0.0), *zip(tactel["readings"], tactel["forces"])]
    if s <= 0.0:
        return 0.0
    for (s0, f0), (s1, f1) in zip(knots, knots[1:]):
        if s <= s1:
            return f0 + (s - s0) / (s1 - s0) * (f1 - f0)
    return knots[-1][1]


forces = {tuple(place): 0.0 for place in pad["dead"]}
for tactel in pad["tactels"]:
    assert tuple(tactel["at"]) not in forces, tactel
    forces[tuple(tactel["at"])] = force(tactel)
places = [(i, j) for i in range(pad["rows"]) for j in range(pad["cols"])]
assert sorted(forces) == places, "every tactel stands in the file once"
print(" ".join(f"{forces[place]:.9g}" for place in places))
