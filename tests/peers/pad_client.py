"""Reads frames of a pad with its maker's client from the package index, which knows nothing of this project.

    pad_client.py flexitac|anyskin PORT COUNT

`flexitac` is a FlexiTac of 12 by 32 tactels. `anyskin` has five chips. It prints the frames as JSON, one list of numbers
each, as the client decodes them: the tactels row after row, or temperature, x, y and z of one chip after the other.
"""

import contextlib
import json
import os
import sys


def flexitac(port, count):
    from flexitac import FlexiTacSensor

    with FlexiTacSensor(port, rows=12, cols=32, baseline=0.0) as sensor:
        frames = [sensor.read().raw for _ in range(count)]
    assert all(frame.shape == (12, 32) for frame in frames)
    return [frame.flatten().tolist() for frame in frames]


def anyskin(port, count):
    from anyskin.sensor import AnySkinBase

    with AnySkinBase(num_mags=5, port=port, temp_filtered=False, burst_mode=True) as sensor:
        return [sensor.get_sample()[1].tolist() for _ in range(count)]


def main():
    kind, port, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
    # The clients print what they do.
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        frames = {"flexitac": flexitac, "anyskin": anyskin}[kind](port, count)
    print(json.dumps(frames))


main()
