"""The protocol of ``docs/processes.md``: values as bytes, frames, and the signature."""

from __future__ import annotations

import json
import os
import struct
import sys
from typing import Any, BinaryIO, Dict, Optional, Tuple

import numpy as np

from .ports import Frame, Port

HEADER = struct.Struct("<4sIQq")
MARK = b"TFLO"
NO_CLOCK = -(2**63)


class Reader:
    """Takes values from the front of a frame."""

    def __init__(self, body: memoryview) -> None:
        self.body, self.at = body, 0

    def take(self, layout: str) -> Tuple[Any, ...]:
        values = struct.unpack_from("<" + layout, self.body, self.at)
        self.at += struct.calcsize("<" + layout)
        return values

    def array(self, kind: str, count: int) -> np.ndarray:
        array = np.frombuffer(self.body, dtype=kind, count=count, offset=self.at)
        self.at += array.nbytes
        return array


def read_value(reader: Reader, port: Port, shape: Dict[str, Any], stamp: int) -> Any:
    """Returns the value of an input."""
    if port.kind == "scalar":
        return reader.take("d")[0]
    if port.kind == "flag":
        return reader.take("B")[0] != 0
    if port.kind == "features":
        (count,) = reader.take("I")
        parts = [reader.take("Bd") for _ in range(count)]
        names = [part["name"] for part in shape.get("features", [])]
        return {name: (value if there else None) for name, (there, value) in zip(names, parts)}
    if port.kind in ("image", "vector_image"):
        rows, cols = reader.take("II")
        size = (rows, cols) if port.kind == "image" else (rows, cols, 3)
        cells = reader.array("<f4", int(np.prod(size))).reshape(size)
        pitch = tuple(shape.get("pitch", (1.0, 1.0)))
        return Frame(cells, pitch, _unit_text(shape.get("unit", "raw")), stamp)  # type: ignore[arg-type]
    if port.kind == "mask":
        rows, cols = reader.take("II")
        words = reader.array("<u8", rows * ((cols + 63) // 64)).reshape(rows, -1)
        bits = np.unpackbits(words.view(np.uint8), axis=1, bitorder="little")
        return bits[:, :cols].astype(bool)
    if port.kind == "twist":
        return np.array(reader.take("6d"))
    if port.kind == "joints":
        (count,) = reader.take("I")
        return reader.array("<f8", count)
    raise ValueError(f"an input of the kind {port.kind} is not read")


def _unit_text(unit: Any) -> str:
    return unit if isinstance(unit, str) else json.dumps(unit)


def value_bytes(name: str, port: Port, value: Any) -> bytes:
    """Returns the bytes of an output, with its presence before them."""
    if value is None:
        return b"\0"
    if port.kind == "scalar":
        return b"\1" + struct.pack("<d", float(value))
    if port.kind == "flag":
        return b"\1" + (b"\1" if value else b"\0")
    if port.kind == "features":
        strange = set(value) - {part for part, _ in port.features}
        if strange:
            raise ValueError(f"output `{name}` has no feature {sorted(strange)}")
        parts = [value.get(part) for part, _ in port.features]
        packed = [struct.pack("<Bd", part is not None, 0.0 if part is None else float(part)) for part in parts]
        return b"\1" + struct.pack("<I", len(parts)) + b"".join(packed)
    cells = np.ascontiguousarray(getattr(value, "cells", value), dtype="<f4")
    shape = (port.rows, port.cols) if port.kind == "image" else (port.rows, port.cols, 3)
    if cells.shape != shape:
        raise ValueError(f"output `{name}` has the shape {cells.shape}, and the signature states {shape}")
    return b"\1" + struct.pack("<II", *cells.shape[:2]) + cells.tobytes()


def frame_bytes(number: int, stamp: int, body: bytes) -> bytes:
    """Returns a frame with its header."""
    return HEADER.pack(MARK, len(body), number, stamp) + body


def by_name(outputs: Dict[str, Port], result: Any) -> Dict[str, Any]:
    """Returns what a function returned as values by the names of its outputs."""
    if result is None:
        return {}
    if not isinstance(result, dict):
        if len(outputs) != 1:
            kind = type(result).__name__
            raise ValueError(f"it returns a {kind}: return a dictionary with its outputs {sorted(outputs)}")
        return {next(iter(outputs)): result}
    strange = set(result) - set(outputs)
    if strange:
        raise ValueError(f"it returns {sorted(strange)}, and its outputs are {sorted(outputs)}")
    return result


def answer_bytes(outputs: Dict[str, Port], result: Any) -> bytes:
    """Returns the body of an answer."""
    values = by_name(outputs, result)
    return b"".join(value_bytes(name, port, values.get(name)) for name, port in outputs.items())


def read_exactly(stream: BinaryIO, count: int) -> Optional[bytearray]:
    """Reads so many bytes, or returns None at the end."""
    buffer = bytearray(count)
    view, got = memoryview(buffer), 0
    while got < count:
        read = stream.readinto(view[got:])  # type: ignore[attr-defined]
        if not read:
            return None
        got += read
    return buffer


def take_standard_output() -> BinaryIO:
    """Returns the pipe to tactflow. What the program prints goes to the standard error from now on."""
    pipe = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return pipe


def write(pipe: BinaryIO, data: bytes) -> None:
    """Writes all bytes."""
    view = memoryview(data)
    while view:
        view = view[pipe.write(view) :]


def start(pipe: BinaryIO, signature: Dict[str, Any]) -> Optional[Dict[str, Any]]:
    """States the signature, and waits for the start. Returns None if there is none."""
    write(pipe, json.dumps(signature).encode() + b"\n")
    line = sys.stdin.buffer.readline()
    return json.loads(line) if line else None

