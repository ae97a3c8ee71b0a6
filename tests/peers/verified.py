"""What `tactflow verify --json` says, read by a reader of JSON that is not ours: a line a scenario."""

import json
import sys


def refuse(constant):
    raise ValueError(f"{constant} is no JSON")


with open(sys.argv[1], encoding="utf-8") as file:
    said = json.load(file, parse_constant=refuse)

for scenario in said["scenarios"]:
    ok = "ok" if scenario["ok"] else "not ok"
    runs = scenario["runs"]
    failed = sum(run["failure"] is not None for run in runs)
    marks = " ".join(row["mark"] for row in scenario["rows"])
    for row in scenario["rows"]:
        assert len(row["values"]) == len(runs), row
        assert (row["judged"] is None) == (row["mark"] == "informational"), row
    print(f"{scenario['name']}: {ok}, {len(runs)} runs, {failed} failed, {marks}")
assert said["ok"] == all(scenario["ok"] for scenario in said["scenarios"])
