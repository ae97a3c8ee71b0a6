"""Reads a Bode plot that `tune --svg` drew, with the standard library's XML parser.

Takes the scales from the printed numbers of the axes. Prints the frequency at which the first curve of the magnitude
crosses 0 dB, its distance from -180 degrees there, the number of dots, and the largest distance of a dot of the
magnitude from the curve.
"""

import math
import sys
import xml.etree.ElementTree as xml

SVG = "{http://www.w3.org/2000/svg}"
root = xml.parse(sys.argv[1]).getroot()
width, height = map(float, root.get("viewBox").split()[2:])


def texts(anchor):
    found = [one for one in root.findall(SVG + "text") if one.get("text-anchor") == anchor and one.get("x")]
    return [(float(one.get("x")), float(one.get("y")), one.text) for one in found]


def line(places):
    """The line through the first and the last printed number of an axis: from a place to a value."""
    (a, u), (b, v) = places[0], places[-1]
    return lambda at: u + (at - a) / (b - a) * (v - u)


def is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


assert all(0 <= x <= width and 0 <= y <= height for anchor in ("start", "middle", "end") for x, y, _ in texts(anchor))
log_hz = line([(x, math.log(float(text))) for x, _, text in texts("middle") if is_number(text)])
# The numbers stand 4.5 px below their ticks. Those of the magnitude come first, and then those of the phase.
numbers = [(y - 4.5, float(text)) for _, y, text in texts("end") if is_number(text)]
split = next(i for i in range(1, len(numbers)) if numbers[i][0] > numbers[i - 1][0])
db, degrees = line(numbers[:split]), line(numbers[split:])

groups = [group for group in root.findall(SVG + "g") if group.get("stroke-width") == "2"]
lines = [[tuple(map(float, point.split(","))) for point in group[0].get("points").split()] for group in groups]
# The first one is that of the legend.
magnitude = [(math.exp(log_hz(x)), db(y)) for x, y in lines[1]]
phase = [(math.exp(log_hz(x)), degrees(y)) for x, y in lines[2]]


def at(curve, hz):
    """The value of a curve at a frequency."""
    (a, u), (b, v) = next(pair for pair in zip(curve, curve[1:]) if pair[1][0] >= hz)
    return u + (math.log(hz / a) / math.log(b / a)) * (v - u)


crossings = [a[0] * (b[0] / a[0]) ** (a[1] / (a[1] - b[1])) for a, b in zip(magnitude, magnitude[1:]) if a[1] > 0 >= b[1]]
dots = [(float(dot.get("cx")), float(dot.get("cy"))) for dot in root.findall(SVG + "circle")]
upper = [(math.exp(log_hz(x)), db(y)) for x, y in dots[: len(dots) // 2]]
far = max(abs(value - at(magnitude, hz)) for hz, value in upper)
print(f"{crossings[-1]:.3f} {180 + at(phase, crossings[-1]):.1f} {len(dots)} {far:.1f}")
