"""Programs: a node that answers questions, and a pad that sends frames."""

from __future__ import annotations

import argparse
import os
import sys
import threading
from typing import Iterator, Optional, Sequence, Tuple, Union

import numpy as np

from .alone import try_alone
from .failure import naming_the_line
from .ports import VERSION, Image, Node, VectorImage
from .protocol import (
    HEADER,
    MARK,
    NO_CLOCK,
    Reader,
    answer_bytes,
    frame_bytes,
    read_exactly,
    read_value,
    start,
    take_standard_output,
    write,
)


def main(what: Node, arguments: Optional[Sequence[str]] = None) -> None:
    """Runs a node: for tactflow, or alone with ``--test``."""
    parser = argparse.ArgumentParser(description=what.doc.splitlines()[0] if what.doc else what.name)
    parser.add_argument(
        "--test",
        metavar="FILE",
        help="run alone on a recording (.mcap), on an export of it (.npz), or on .npz with one array for each input",
    )
    parser.add_argument(
        "--wire",
        metavar="INPUT=PORT",
        action="append",
        default=[],
        help="with --test: the port or the array of an input, where it has another name",
    )
    parser.add_argument(
        "--pitch",
        metavar="MM",
        type=float,
        default=5.0,
        help="with --test on .npz: distance between two tactels (default: %(default)s mm)",
    )
    parsed = parser.parse_args(arguments)
    with naming_the_line(getattr(what.function, "__code__", None)):
        if parsed.test:
            sys.exit(try_alone(what, parsed.test, parsed.wire, parsed.pitch * 1e-3))
        _serve(what)


def _serve(what: Node) -> None:
    pipe, stdin = take_standard_output(), sys.stdin.buffer
    begin = start(pipe, what.signature())
    if begin is None:
        return
    shapes = [one.get("shape", {}) for one in begin["inputs"]]
    params = {name: begin["params"].get(name, default) for name, (default, _) in what.params.items()}
    while True:
        header = read_exactly(stdin, HEADER.size)
        if header is None:
            return
        mark, length, number, stamp = HEADER.unpack(header)
        if mark != MARK:
            raise ValueError("the tool sends what is no frame")
        body = read_exactly(stdin, length)
        if body is None:
            return
        reader = Reader(memoryview(body).toreadonly())
        values = {}
        for (name, port), shape in zip(what.inputs.items(), shapes):
            state, own = reader.take("Bq")
            values[name] = read_value(reader, port, shape, own) if state else None
        more = {"stamp": stamp} if what.wants_stamp else {}
        result = what.function(**values, **params, **more)
        write(pipe, frame_bytes(number, stamp, answer_bytes(what.outputs, result)))


def pad(
    frames: Iterator[Union[np.ndarray, Tuple[int, np.ndarray]]],
    name: str,
    unit: str,
    rows: int,
    cols: int,
    pitch: Tuple[float, float],
    doc: str = "",
    axes: int = 1,
) -> None:
    """Runs a pad: sends each array of ``frames``. A pair is a time of the sensor's own clock [ns] and an array.
    With ``axes=3``, arrays have a third axis: x, y and z of each tactel, and z is positive where an object presses."""
    if axes not in (1, 3):
        raise ValueError(f"a pad has 1 or 3 axes, and not {axes}")
    output = "image" if axes == 1 else "vectors"
    port = (Image if axes == 1 else VectorImage)(unit, rows, cols, pitch)
    outputs = {output: port}
    signature = {"tactflow": VERSION, "name": name, "doc": doc, "inputs": [], "outputs": [port.describe(output)]}
    pipe = take_standard_output()
    if start(pipe, signature) is None:
        return
    _end_with_input()
    with naming_the_line(getattr(frames, "gi_code", None)):
        for number, frame in enumerate(frames, start=1):
            stamp, cells = frame if isinstance(frame, tuple) else (NO_CLOCK, frame)
            write(pipe, frame_bytes(number, stamp, answer_bytes(outputs, {output: cells})))


def _end_with_input() -> None:
    """Ends the program when its standard input ends: the run is over then."""

    def wait() -> None:
        while sys.stdin.buffer.read(1):
            pass
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()
