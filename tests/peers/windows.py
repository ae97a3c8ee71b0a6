"""The figures of a check in a window, from a recording.

The arguments are the recording, and then five words for each check: the column, the flag of time 0, the number of the
mode, the number of the mode or the flag that ends the window, and a time in ms; `-` stands for none. Prints a line a
check: max, min and change, in the digits that make the float again, and the number of visits.

Knows nothing of the code that it checks: it cuts lists of rows instead of following a clock.
"""

import csv
import sys

path, words = sys.argv[1], sys.argv[2:]
with open(path, newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
# A row has the mode of the next tick, and the first tick runs in the mode that the graph starts with.
modes = [0] + [int(float(row["mode"])) for row in rows[:-1]] if "mode" in rows[0] else [None] * len(rows)
ticks = [
    {"ns": round(float(row["time"]) * 1e9), "is_in": mode, "row": row} for mode, row in zip(modes, rows, strict=True)
]


def holds(tick, word):
    return tick["is_in"] == int(word) if word.isdigit() else tick["row"][word] == "1.0"


for column, start, during, until, after in zip(*[iter(words)] * 5, strict=True):
    window = list(ticks)
    while start != "-" and not holds(window[0], start):
        window.pop(0)
    if until != "-":
        pairs = zip(window, window[1:])
        end = next(i for i, (before, tick) in enumerate(pairs, 1) if holds(tick, until) and not holds(before, until))
        window = window[:end]
    visits, gap = [], True
    for tick in window:
        is_in = during == "-" or holds(tick, during)
        if is_in and gap:
            visits.append([])
        if is_in:
            visits[-1].append(tick)
        gap = not is_in
    late = [tick for visit in visits for tick in visit if tick["ns"] - visit[0]["ns"] >= int(after) * 1_000_000]
    values = [float(tick["row"][column]) for tick in late if tick["row"][column]]
    print(max(values), min(values), values[-1] - values[0], f"in {len(visits)} visits")
