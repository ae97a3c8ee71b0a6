"""Reads what the tool answers as JSON, as an editor or a script would: with the standard library's json.

The first argument says which command answered, the second is the file with its answer. Prints what the answer says in
a few words; fails on whatever is not as the reference promises.
"""

import json
import sys


def refuse(word):
    raise AssertionError(f"{word} is no JSON")


def place(value):
    assert value["file"] and value["line"] >= 1 and value["column"] >= 1 and value["length"] >= 0, value
    return f"{value['file']}:{value['line']}:{value['column']}+{value['length']}"


def check(graphs):
    for graph in graphs:
        assert graph["ok"] in (True, False) and isinstance(graph["diagnostics"], list)
        figures = graph["figures"]
        if figures:
            assert figures["nodes"] == len(figures["order"]) and figures["period_s"] > 0
            print(f"{graph['graph']}: ok {graph['ok']}, {figures['nodes']} nodes, {figures['period_s']} s")
        else:
            print(f"{graph['graph']}: ok {graph['ok']}")
        for one in graph["diagnostics"]:
            assert one["severity"] in ("error", "warning")
            print(f"{one['severity']}[{one['code']}] {place(one)} {one['message']} | {one['help']}")
            for note in one["notes"]:
                print(f"note {place(note)} {note['message']}")


def listed(entries):
    for entry in entries:
        assert entry["name"] and entry["summary"] and set(entry) == {"category", "name", "summary", "group"}, entry
    print(" ".join(f"{entry['category']}:{entry['name']}" for entry in entries))


def params(entries, path=""):
    for entry in entries:
        assert entry["takes"] and entry["doc"], entry
        default = "required" if entry["is_required"] else entry["default"]
        print(f"param {path}{entry['name']} | {entry['takes']} | {entry['unit']} | {default}")
        params(entry["fields"], f"{path}{entry['name']}.")


def described(entries):
    for entry in entries:
        print(f"{entry['category']} {entry['name']}: {entry['summary']}")
        for sort in ("inputs", "outputs", "commands"):
            for port in entry[sort]:
                frames = " in ".join(port["frames"])
                need = port.get("need")
                print(f"{sort[:-1]} {port['name']} | {port['kind']} | {port['unit']} | {frames} | {need}")
        params(entry["params"])
        if entry.get("example"):
            print(f"example of {entry['example'].count('[nodes.')} nodes")


def settings(entries):
    for setting in entries:
        origin = setting["origin"]
        assert origin in ("written", "default", "fact"), setting
        assert ("place" in setting) == (origin != "default"), setting
        assert ("fact" in setting) == (origin == "fact"), setting
        where = "" if origin == "default" else " " + place(setting["place"])
        fact = f" {setting['fact']}" if origin == "fact" else ""
        print(f"{setting['path']} = {json.dumps(setting['value'])} {origin}{fact}{where}")


def shown(graph):
    print("[policy]")
    settings(graph["policy"])
    for node in graph["nodes"] + graph["devices"]:
        assert place(node["type"]["place"])
        print(f"[{node['name']}] {node['type']['text']}")
        for wire in node["inputs"]:
            assert (wire["max_age_ms"] is None) == (wire["stale"] is None), wire
            age = f" {wire['max_age_ms']} ms {wire['stale']}" if wire["stale"] else ""
            print(f"in.{wire['name']} = {wire['source']}{age} {place(wire['place'])}")
        settings(node["params"])
        for port in node["outputs"]:
            print(f"gives {port['name']} | {port['kind']} | {port['unit']} | {port['frames']}")


with open(sys.argv[2], encoding="utf-8") as file:
    answer = json.load(file, parse_constant=refuse)
{"check": check, "list": listed, "describe": described, "show": shown}[sys.argv[1]](answer)
