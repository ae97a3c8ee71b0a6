"""Compares a picture that `run --svg` drew with the recording of the same run.

Reads the SVG with the standard library's XML parser, takes the scales of the axes from their printed numbers, and holds
every point of every curve against the values of its column of pixels. Prints what the picture has.
"""

import csv
import sys
import xml.etree.ElementTree as xml

SVG = "{http://www.w3.org/2000/svg}"
root = xml.parse(sys.argv[1]).getroot()
assert root.tag == SVG + "svg" and root.get("viewBox"), root.attrib
width, height = map(float, root.get("viewBox").split()[2:])

with open(sys.argv[2], newline="", encoding="utf-8") as file:
    lines = file.readlines()
units = dict(line[2:].rstrip("\n").split(" ", 1) for line in lines if line.startswith("#"))
rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))


def texts(anchor):
    found = [one for one in root.findall(SVG + "text") if one.get("text-anchor") == anchor and one.get("x")]
    return [(float(one.get("x")), float(one.get("y")), one.text) for one in found]


def scale(places):
    """The line through the first and the last printed number of an axis: from a place to a value."""
    (a, u), (b, v) = places[0], places[-1]
    return lambda at: u + (at - a) / (b - a) * (v - u), abs((v - u) / (b - a))


def is_number(text):
    return text.replace("-", "").replace(".", "").isdigit()


image = [group for group in root.findall(SVG + "g") if group.get("class") == "image"]
# A rectangle is a run of square tactels of one colour.
tactels = sum(round(float(rect.get("width")) / float(rect.get("height"))) for one in image for rect in one)
marks = sum(group.get("class") == "mark" for group in root.findall(SVG + "g"))
words = [text for _, y, text in sorted(texts("start")) if y < 38 and not is_number(text)]
title = root.find(SVG + "title").text
print(f"title {title}, {tactels} tactels, {marks} mark, modes {' '.join(words) or 'none'}")

curves = [group for group in root.findall(SVG + "g") if group.get("class") == "curve"]
if curves:
    time_at, second = scale([(x, float(text)) for x, _, text in texts("middle") if is_number(text)])
numbers = [(y, float(text)) for _, y, text in texts("end")]
titles = [one for one in root.findall(SVG + "text") if one.get("transform")]
panels = []
for at, value in numbers:
    # The numbers of a panel rise from its bottom to its top, and the next panel is below.
    if panels and at < panels[-1][-1][0]:
        panels[-1].append((at, value))
    else:
        panels.append([(at, value)])

for curve in curves:
    name = curve.get("data-column")
    points = [tuple(map(float, at.split(","))) for line in curve.findall(SVG + "polyline") for at in line.get("points").split()]
    ys = [y for _, y in points]
    panel = next(i for i, one in enumerate(panels) if min(ys) > one[-1][0] - 60 and max(ys) < one[0][0] + 60)
    unit = titles[panel].text
    # Numbers stand 4.5 px below their ticks.
    value_at, step = scale([(y - 4.5, value) for y, value in panels[panel]])
    assert units[name] == unit, (name, unit)
    values = [(float(row["time"]), float(row[name])) for row in rows if row[name] != ""]
    for x, y in points:
        assert 0 <= x <= width and 0 <= y <= height, (x, y)
        near = [value for time, value in values if abs(time - time_at(x)) <= 1.2 * second]
        assert any(abs(value - value_at(y)) <= 0.2 * step for value in near), (name, x, y)
    for time, value in values:
        near = [value_at(y) for x, y in points if abs(time - time_at(x)) <= 1.2 * second]
        assert near and min(near) - 0.2 * step <= value <= max(near) + 0.2 * step, (name, time, value, near)
    print(f"{name} {unit}: {len(set(points))} points for {len(values)} values")

for _, _, text in texts("start"):
    if text.endswith(": absent"):
        print("absent:", text.removesuffix(": absent"))
