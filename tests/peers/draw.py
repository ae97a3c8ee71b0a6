"""Reads a picture that `draw` made, with the standard library's XML parser.

Checks that every text and every box is inside the picture, that no two boxes overlap, and that every arrow begins and
ends at a box. Prints the number of boxes and of arrows, and the texts.
"""

import sys
import xml.etree.ElementTree as xml

SVG = "{http://www.w3.org/2000/svg}"
root = xml.parse(sys.argv[1]).getroot()
width, height = map(float, root.get("viewBox").split()[2:])


def box(rect):
    x, y, w, h = (float(rect.get(key)) for key in ("x", "y", "width", "height"))
    return x, y, x + w, y + h


rects = root.findall(SVG + "rect")
boxes = [box(rect) for rect in rects if rect.get("fill") != "none"]
frames = [box(rect) for rect in rects if rect.get("fill") == "none"]
for left, top, right, bottom in boxes + frames:
    assert 0 <= left < right <= width and 0 <= top < bottom <= height, (left, top, right, bottom)
for i, a in enumerate(boxes):
    for b in boxes[:i]:
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1], (a, b)


def is_at_box(x, y):
    return any(left - 1 <= x <= right + 1 and top - 1 <= y <= bottom + 1 for left, top, right, bottom in boxes)


lines = [line for line in root.iter(SVG + "polyline")]
for line in lines:
    points = [tuple(map(float, point.split(","))) for point in line.get("points").split()]
    assert is_at_box(*points[0]) and is_at_box(*points[-1]), points
for text in root.iter(SVG + "text"):
    assert 0 <= float(text.get("x")) <= width and 0 <= float(text.get("y")) <= height, text.text
print(len(boxes), len(frames), len(lines))
for text in root.iter(SVG + "text"):
    print(text.text)
