"""Reads a recording as somebody would who has never seen tactflow: with Foxglove's Python library.

Decodes every JSON message by its schema, and compares each number with that of the CSV file of the same run. Prints the
number of ticks, channels and numbers.
"""

import base64
import csv
import json
import struct
import sys

from mcap.reader import make_reader

KINDS = {"number": (int, float), "integer": int, "string": str, "object": dict, "array": list, "boolean": bool, "null": type(None)}


def check(value, schema, where):
    """Compares a value with the parts of JSON Schema that the file uses."""
    kinds = schema.get("type")
    if kinds is not None:
        kinds = kinds if isinstance(kinds, list) else [kinds]
        assert any(isinstance(value, KINDS[kind]) for kind in kinds), (where, value, kinds)
    if "oneOf" in schema:
        assert value in [option["const"] for option in schema["oneOf"]], (where, value)
    if isinstance(value, dict):
        unknown = set(value) - set(schema["properties"])
        assert not unknown, (where, unknown)
        for name, part in schema["properties"].items():
            assert name in value, (where, name)
            check(value[name], part, f"{where}.{name}")
    if isinstance(value, list) and "items" in schema:
        for item in value:
            check(item, schema["items"], where)


def main(path, table):
    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics.message_count > 0, "the file has no index"
        attachments = [attachment.name for attachment in reader.iter_attachments()]
        assert "graphs/hybrid.toml" in attachments and "tactflow/devices.toml" in attachments, attachments
        messages = list(reader.iter_messages(log_time_order=False))
    with open(table, newline="", encoding="utf-8") as file:
        rows = list(csv.reader(line for line in file if not line.startswith("#")))
    header = rows.pop(0)
    ticks = sorted({message.sequence for _, channel, message in messages if channel.topic == "/tactflow/inputs"})
    assert len(ticks) == len(rows), (len(ticks), len(rows))
    decoded, numbers, images = set(), 0, 0
    for schema, channel, message in messages:
        if channel.message_encoding != "json":
            assert channel.topic == "/tactflow/inputs", channel.topic
            continue
        value = json.loads(message.data)
        check(value, json.loads(schema.data), channel.topic)
        decoded.add(channel.topic)
        port = channel.metadata.get("port")
        if port is None:
            continue
        row = dict(zip(header, rows[message.sequence - 1]))
        if schema.name == "foxglove.Grid":
            cells = base64.b64decode(value["data"])
            count = len(cells) // value["cell_stride"]
            assert count % value["column_count"] == 0 and count > 0, channel.topic
            if value["cell_stride"] == 4:
                struct.unpack(f"<{count}f", cells)
            images += 1
            continue
        if schema.name == "foxglove.PoseInFrame":
            parts = {**value["pose"]["position"], **{f"q{axis}": n for axis, n in value["pose"]["orientation"].items()}}
        elif "regions" in value or "columns" in value:
            continue
        else:
            assert float(row["time"]) == value["t"], (row["time"], value["t"])
            parts = {name: number for name, number in value.items() if name != "t"}
        for name, number in parts.items():
            column = port if name == "value" and port in row else f"{port}.{name}"
            cell = row[column]
            assert (float(cell) if cell else None) == (None if number is None else float(number)), (column, cell, number)
            numbers += 1
    frames = {json.loads(m.data)["child_frame_id"] for _, c, m in messages if c.topic == "/tf"}
    assert "pad" in frames, frames
    silent = {channel.topic for channel in summary.channels.values()} - decoded
    print(f"{len(ticks)} ticks, {len(decoded)} channels, {numbers} numbers, {images} images, silent: {sorted(silent)}")


main(*sys.argv[1:])
