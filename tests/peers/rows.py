"""Reads what `--out` wrote, as somebody would who has never seen tactflow: with the standard library's csv and json.

Prints the number of rows, of columns and of empty cells, and a digest of the values; fails on whatever is not as the
file itself promises.
"""

import csv
import hashlib
import json
import math
import sys


def of_csv(path):
    with open(path, newline="", encoding="utf-8") as file:
        lines = file.readlines()
    assert all(line.endswith("\n") for line in lines), "a line was cut off"
    comments = [line for line in lines if line.startswith("#")]
    assert lines[: len(comments)] == comments, "comments stand before the header only"
    units = {}
    of_columns = [comment for comment in comments if comment.endswith("]\n")]
    about = comments[len(of_columns) :]
    assert comments[: len(of_columns)] == of_columns, "units come first"
    assert about and about[0].startswith("# tactflow "), about
    for comment in of_columns:
        name, unit = comment[2:].rstrip("\n").split(" ", 1)
        assert unit.startswith("[") and unit.endswith("]"), comment
        assert name not in units, name
        units[name] = unit[1:-1]
    rows = list(csv.reader(lines[len(comments) :]))
    header = rows.pop(0)
    for row in rows:
        assert len(row) == len(header), row
    return units, [dict(zip(header, [float(cell) if cell else None for cell in row])) for row in rows]


def of_ndjson(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    assert text.endswith("\n"), "the last line was cut off"

    def refuse(word):
        raise AssertionError(f"{word} is no JSON")

    rows = [json.loads(line, parse_constant=refuse) for line in text.splitlines()]
    units, about = rows[0].pop("units"), rows[0].pop("about")
    assert about[0].startswith("tactflow "), about
    return units, rows if rows[0] else []


path = sys.argv[1]
units, rows = of_csv(path) if path.endswith(".csv") else of_ndjson(path)
assert units["time"] == "s" and all(units.values()), units
times = [row["time"] for row in rows]
assert all(before < after for before, after in zip(times, times[1:])), "times rise"
digest, empty = hashlib.sha256(), 0
for row in rows:
    assert sorted(row) == sorted(units), "every column has a unit"
    assert all(value is None or math.isfinite(value) for value in row.values()), row
    empty += sum(value is None for value in row.values())
    digest.update(repr(sorted(row.items())).encode())
print(f"{len(rows)} rows, {len(units)} columns, {empty} empty cells, {digest.hexdigest()[:16]}")
