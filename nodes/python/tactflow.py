"""Nodes and pads of tactflow in Python, and its recordings as arrays.

A node is a function. Its annotations name the kind and the unit of each port::

    import tactflow
    from tactflow import Image, Param, Scalar

    @tactflow.node
    def centre(image: Image["N"], floor: Param["N"] = 0.01) -> {"x": Scalar["m"]}:
        '''The centre of the force along x.'''
        force = image.cells.clip(floor) - floor
        total = force.sum()
        return {"x": None if total == 0.0 else (force.sum(axis=0) @ image.x) / total}

    if __name__ == "__main__":
        tactflow.main(centre)

``tactflow signature -- python3 centre.py`` writes the file that a graph needs. ``python3 centre.py --test frames.npz``
runs the function alone. ``docs/processes.md`` describes the protocol that this module speaks.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import struct
import sys
import time
from dataclasses import dataclass
from typing import Any, BinaryIO, Callable, Dict, Iterator, List, Optional, Sequence, Tuple, Union

import numpy as np

VERSION = 1
"""Version of the protocol."""

_HEADER = struct.Struct("<4sIQq")
_MARK = b"TFLO"
_NO_CLOCK = -(2**63)
_TIMELESS = 2**63 - 1


@dataclass(frozen=True)
class Port:
    """The kind of a port, and its unit or its features."""

    kind: str
    unit: Optional[str] = None
    features: Tuple[Tuple[str, str], ...] = ()
    rows: Optional[int] = None
    cols: Optional[int] = None
    pitch: Optional[Tuple[float, float]] = None
    doc: str = ""

    def describe(self, name: str) -> Dict[str, Any]:
        """Returns the port as the signature states it."""
        text: Dict[str, Any] = {"name": name, "kind": self.kind}
        for key in ("unit", "rows", "cols", "pitch"):
            if getattr(self, key) is not None:
                text[key] = getattr(self, key)
        if self.doc:
            text["doc"] = self.doc
        if self.features:
            text["features"] = [{"name": part, "unit": unit} for part, unit in self.features]
        return text


class _Kind:
    """``Kind["N"]`` is a port of that unit, and ``Kind["N", "its meaning"]`` documents it."""

    def __init__(self, kind: str) -> None:
        self.kind = kind

    def __getitem__(self, argument: Union[str, Tuple[str, str]]) -> Port:
        unit, doc = argument if isinstance(argument, tuple) else (argument, "")
        return Port(self.kind, unit=unit, doc=doc)


@dataclass(frozen=True)
class _ParamUnit:
    unit: Optional[str]
    doc: str = ""


class _Param:
    """``Param["N"]`` is a parameter in that unit. Its default is that of the argument of the function."""

    def __getitem__(self, argument: Union[str, Tuple[str, str]]) -> _ParamUnit:
        unit, doc = argument if isinstance(argument, tuple) else (argument, "")
        return _ParamUnit(unit, doc)


Scalar = _Kind("scalar")
"""A number with a unit: ``Scalar["m"]``."""
Param = _Param()
"""A parameter of a node: ``floor: Param["N"] = 0.01``."""
Flag = Port("flag")
"""True or false."""
Mask = Port("mask")
"""True or false for each tactel, as an array of bool."""
Twist = Port("twist")
"""Six numbers: the linear velocity [m/s], then the angular velocity [rad/s]."""


class _Image(_Kind):
    def __getitem__(self, argument: Union[str, Tuple[str, str]]) -> Port:
        return super().__getitem__(argument)

    def __call__(self, unit: str, rows: int, cols: int, pitch: Tuple[float, float], doc: str = "") -> Port:
        """An image as an output: with its size, and with the distance between two tactels along x and y [m]."""
        return Port(self.kind, unit=unit, rows=rows, cols=cols, pitch=pitch, doc=doc)


class _Features:
    def __call__(self, doc: str = "", **units: str) -> Port:
        """Named numbers, each with its unit: ``Features(x="m", force="N")``."""
        return Port("features", features=tuple(units.items()), doc=doc)


Image = _Image("image")
"""An image of a pad. An input is ``Image["N"]``, and an output ``Image("N", 16, 16, (0.005, 0.005))``."""
VectorImage = _Image("vector_image")
"""A vector image of a pad with three axes, written as an image. Its cells have the axes row, column, [x, y, z]."""
Features = _Features()
"""Features: an input is ``Features()``, and an output ``Features(x="m")``. Values are dictionaries; an absent one is None."""


@dataclass
class Frame:
    """An image of a pad, as an array without a copy. The array is read-only."""

    cells: np.ndarray
    """The values, row by row: ``float32``. Those of a vector image have a third axis: x, y and z."""
    pitch: Tuple[float, float] = (1.0, 1.0)
    """Distance between the centres of two tactels along x and y [m]."""
    unit: str = "raw"
    """Unit of the values."""
    stamp: int = _TIMELESS
    """Time of the image [ns]."""

    @property
    def x(self) -> np.ndarray:
        """The x of each column from the centre of the pad [m]."""
        cols = self.cells.shape[1]
        return (np.arange(cols) - (cols - 1) / 2) * self.pitch[0]

    @property
    def y(self) -> np.ndarray:
        """The y of each row from the centre of the pad [m]."""
        rows = self.cells.shape[0]
        return (np.arange(rows) - (rows - 1) / 2) * self.pitch[1]


@dataclass
class Node:
    """A node: a function with its ports and its parameters."""

    function: Callable[..., Any]
    name: str
    doc: str
    inputs: Dict[str, Port]
    outputs: Dict[str, Port]
    params: Dict[str, Tuple[float, _ParamUnit]]
    wants_stamp: bool = False

    def signature(self) -> Dict[str, Any]:
        """Returns the signature as the protocol states it."""
        params = []
        for name, (default, annotation) in self.params.items():
            param: Dict[str, Any] = {"name": name, "default": default}
            if annotation.unit is not None:
                param["unit"] = annotation.unit
            if annotation.doc:
                param["doc"] = annotation.doc
            params.append(param)
        return {
            "tactflow": VERSION,
            "name": self.name,
            "doc": self.doc,
            "inputs": [port.describe(name) for name, port in self.inputs.items()],
            "outputs": [port.describe(name) for name, port in self.outputs.items()],
            "params": params,
        }

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.function(*args, **kwargs)


def node(function: Callable[..., Any]) -> Node:
    """Makes a node of a function: its arguments are inputs and parameters, and its annotation of what it returns names the
    outputs. An argument that is called ``stamp`` gets the oldest time of the new inputs [ns]."""
    annotations = _annotations(function)
    inputs: Dict[str, Port] = {}
    params: Dict[str, Tuple[float, _ParamUnit]] = {}
    wants_stamp = False
    for name, argument in inspect.signature(function).parameters.items():
        annotation = annotations.get(name)
        if name == "stamp" and annotation in (None, int):
            wants_stamp = True
        elif isinstance(annotation, Port):
            inputs[name] = annotation
        elif isinstance(annotation, _ParamUnit) or annotation is Param:
            if argument.default is inspect.Parameter.empty:
                raise TypeError(f"the parameter `{name}` of `{function.__name__}` needs a default")
            unit = annotation if isinstance(annotation, _ParamUnit) else _ParamUnit(None)
            params[name] = (float(argument.default), unit)
        else:
            raise TypeError(
                f"the argument `{name}` of `{function.__name__}` needs a kind: for example `{name}: Image[\"N\"]`, or "
                f"`{name}: Param[\"N\"] = 0.1` for a parameter"
            )
    outputs = annotations.get("return")
    if not isinstance(outputs, dict) or not outputs or not all(isinstance(port, Port) for port in outputs.values()):
        raise TypeError(
            f"`{function.__name__}` must name its outputs: for example `-> {{\"x\": Scalar[\"m\"]}}`"
        )
    doc = inspect.getdoc(function) or ""
    return Node(function, function.__name__, doc, inputs, outputs, params, wants_stamp)


def _annotations(function: Callable[..., Any]) -> Dict[str, Any]:
    """Returns the annotations as values, also of a module with ``from __future__ import annotations``."""
    raw = dict(getattr(function, "__annotations__", {}))
    names = dict(function.__globals__)  # type: ignore[attr-defined]
    return {name: eval(text, names) if isinstance(text, str) else text for name, text in raw.items()}  # noqa: S307


# --- bytes ---------------------------------------------------------------------------------------------------------


class _Reader:
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


def _read_value(reader: _Reader, port: Port, shape: Dict[str, Any], stamp: int) -> Any:
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


def _value_bytes(name: str, port: Port, value: Any) -> bytes:
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


def _frame(number: int, stamp: int, body: bytes) -> bytes:
    return _HEADER.pack(_MARK, len(body), number, stamp) + body


def _outputs(outputs: Dict[str, Port], values: Any) -> bytes:
    if not isinstance(values, dict):
        values = {next(iter(outputs)): values} if len(outputs) == 1 else {}
    strange = set(values) - set(outputs)
    if strange:
        raise ValueError(f"it returns {sorted(strange)}, and its outputs are {sorted(outputs)}")
    return b"".join(_value_bytes(name, port, values.get(name)) for name, port in outputs.items())


def _read_exactly(stream: BinaryIO, count: int) -> Optional[bytearray]:
    """Reads so many bytes, or returns None at the end."""
    buffer = bytearray(count)
    view, got = memoryview(buffer), 0
    while got < count:
        read = stream.readinto(view[got:])  # type: ignore[attr-defined]
        if not read:
            return None
        got += read
    return buffer


def _take_standard_output() -> BinaryIO:
    """Returns the pipe to tactflow. What the program prints goes to the standard error from now on."""
    pipe = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return pipe


def _write(pipe: BinaryIO, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[pipe.write(view) :]


def _start(pipe: BinaryIO, signature: Dict[str, Any]) -> Optional[Dict[str, Any]]:
    """States the signature, and waits for the start. Returns None if there is none."""
    _write(pipe, json.dumps(signature).encode() + b"\n")
    line = sys.stdin.buffer.readline()
    return json.loads(line) if line else None


# --- nodes ---------------------------------------------------------------------------------------------------------


def main(what: Node, arguments: Optional[Sequence[str]] = None) -> None:
    """Runs a node: for tactflow, or alone with ``--test``."""
    parser = argparse.ArgumentParser(description=what.doc.splitlines()[0] if what.doc else what.name)
    parser.add_argument("--test", metavar="FILE", help="run alone on a recording: .npz with one array for each input, or .mcap")
    parser.add_argument("--pitch", metavar="MM", type=float, default=5.0, help="with --test on .npz: distance between two tactels (default: %(default)s mm)")
    parser.add_argument("--wire", metavar="INPUT=PORT", action="append", default=[], help="with --test on .mcap: port of an input, where several have its name")
    parsed = parser.parse_args(arguments)
    try:
        if parsed.test:
            if parsed.test.endswith(".mcap"):
                wires = dict(wire.partition("=")[::2] for wire in parsed.wire)
                inputs = _recorded_inputs(what, parsed.test, wires)
            else:
                inputs = _archived_inputs(what, parsed.test, parsed.pitch * 1e-3)
            _test(what, inputs)
        else:
            _serve(what)
    except (BrokenPipeError, KeyboardInterrupt):
        pass


def _serve(what: Node) -> None:
    pipe, stdin = _take_standard_output(), sys.stdin.buffer
    start = _start(pipe, what.signature())
    if start is None:
        return
    shapes = [one.get("shape", {}) for one in start["inputs"]]
    params = {name: start["params"].get(name, default) for name, (default, _) in what.params.items()}
    while True:
        header = _read_exactly(stdin, _HEADER.size)
        if header is None:
            return
        mark, length, number, stamp = _HEADER.unpack(header)
        if mark != _MARK:
            raise ValueError("the tool sends what is no frame")
        body = _read_exactly(stdin, length)
        if body is None:
            return
        reader = _Reader(memoryview(body).toreadonly())
        values = {}
        for (name, port), shape in zip(what.inputs.items(), shapes):
            state, own = reader.take("Bq")
            values[name] = _read_value(reader, port, shape, own) if state else None
        more = {"stamp": stamp} if what.wants_stamp else {}
        _write(pipe, _frame(number, stamp, _outputs(what.outputs, what.function(**values, **params, **more))))


def _test(what: Node, inputs: Dict[str, List[Any]]) -> None:
    """Prints the outputs for each frame of a recording, and how long the function takes."""
    count = min(len(values) for values in inputs.values())
    params = {name: default for name, (default, _) in what.params.items()}
    times = []
    for i in range(count):
        values = {name: inputs[name][i] for name in what.inputs}
        more = {"stamp": i} if what.wants_stamp else {}
        begin = time.perf_counter()
        result = what.function(**values, **params, **more)
        times.append(time.perf_counter() - begin)
        _outputs(what.outputs, result)
        print(i, _shown(result))
    if times:
        middle, late = np.percentile(np.array(times) * 1e3, [50, 99])
        print(f"{count} frames; {middle:.3f} ms each, and {late:.3f} ms for the slowest in a hundred")


def _archived_inputs(what: Node, path: str, pitch: float) -> Dict[str, List[Any]]:
    """Reads the inputs from arrays by their names. An image is in the unit that the node states."""
    archive = np.load(path)
    missing = [name for name in what.inputs if name not in archive.files]
    if missing:
        raise SystemExit(f"{path} has no array {missing}; it has {archive.files}")

    def value(port: Port, one: Any) -> Any:
        return Frame(np.asarray(one, np.float32), (pitch, pitch), port.unit or "raw") if port.kind in ("image", "vector_image") else one

    return {name: [value(port, one) for one in archive[name]] for name, port in what.inputs.items()}


def _recorded_inputs(what: Node, path: str, wires: Dict[str, str]) -> Dict[str, List[Any]]:
    """Reads the inputs from a recording: for each value of the first one, the newest values of the others."""
    strange = sorted(set(wires) - set(what.inputs))
    if strange:
        raise SystemExit(f"there is no input {strange}; the inputs are {list(what.inputs)}")
    recording = open(path)
    series = {name: recording[_only_port(recording, wires.get(name, name), name)] for name in what.inputs}
    times = next(iter(series.values())).times

    def value(port: Series, at: int) -> Any:
        if at < 0:
            return None
        one = port.values[at]
        if port.kind in ("image", "vector_image"):
            return Frame(one, port.pitch or (1.0, 1.0), port.units[0], int(round(port.times[at] * 1e9)))
        return dict(zip(port.columns, (None if np.isnan(part) else part for part in one))) if port.kind == "features" else one

    newest = {name: np.searchsorted(port.times, times, side="right") - 1 for name, port in series.items()}
    return {name: [value(port, at) for at in newest[name]] for name, port in series.items()}


def _only_port(recording: "Recording", name: str, of: str) -> str:
    fitting = [port for port in recording if port == name] or [port for port in recording if port.endswith("." + name)]
    if len(fitting) == 1:
        return fitting[0]
    known = ", ".join(sorted(fitting or recording))
    raise SystemExit(f"the recording has {len(fitting) or 'no'} ports `{name}`: write `--wire {of}=PORT` with one of {known}")


def _shown(result: Any) -> str:
    if isinstance(result, dict):
        return "  ".join(f"{name}={_shown(value)}" for name, value in result.items())
    return f"{result:.6g}" if isinstance(result, float) else str(result)


# --- pads ----------------------------------------------------------------------------------------------------------


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
    pipe = _take_standard_output()
    if _start(pipe, signature) is None:
        return
    _end_with_input()
    try:
        for number, frame in enumerate(frames, start=1):
            stamp, cells = frame if isinstance(frame, tuple) else (_NO_CLOCK, frame)
            _write(pipe, _frame(number, stamp, _outputs(outputs, {output: cells})))
    except (BrokenPipeError, KeyboardInterrupt):
        pass


def _end_with_input() -> None:
    """Ends the program when its standard input ends: the run is over then."""
    import threading

    def wait() -> None:
        while sys.stdin.buffer.read(1):
            pass
        os._exit(0)

    threading.Thread(target=wait, daemon=True).start()


# --- recordings ----------------------------------------------------------------------------------------------------


@dataclass
class Series:
    """The values of a port over time."""

    times: np.ndarray
    """Time of each value [s]."""
    values: np.ndarray
    """The values: one row for each time. An absent number is NaN, and an absent flag is None."""
    kind: str
    """Kind of the port."""
    columns: List[str]
    """Names of the numbers of a row: those of features, and `vx`, `vy`, ... of a twist. Empty texts for a single number."""
    units: List[str]
    """Unit of each number of a row; one for the whole image."""
    pitch: Optional[Tuple[float, float]] = None
    """Of an image or a mask: the distance between the centres of two tactels along x and y [m]."""


class Recording(Dict[str, Series]):
    """The ports of a recording by name. ``info`` is what the recording states of the run."""

    info: Dict[str, Any]


def open(path: str) -> Recording:  # noqa: A001
    """Reads a recording of a run (``tactflow run --record``) into arrays by the names of the ports."""
    try:
        from mcap.reader import make_reader
    except ImportError as error:
        raise ImportError("reading a recording needs the package `mcap`: pip install mcap") from error
    import builtins

    recording = Recording()
    recording.info = {}
    raw: Dict[str, Tuple[Dict[str, str], List[int], List[Any]]] = {}
    with builtins.open(path, "rb") as stream:
        reader = make_reader(stream)
        for metadata in reader.iter_metadata():
            recording.info[metadata.name] = dict(metadata.metadata)
        for _, channel, message in reader.iter_messages():
            if "port" not in channel.metadata:
                continue
            _, times, values = raw.setdefault(channel.metadata["port"], (channel.metadata, [], []))
            times.append(message.log_time)
            values.append(json.loads(message.data))
    for name, (about, times, values) in raw.items():
        units = [unit for _, unit in json.loads(about["units"])]
        columns = [part for part, _ in json.loads(about["units"])]
        size = values[0].get("cell_size")
        recording[name] = Series(
            times=np.array(times) * 1e-9,
            values=_values(about["kind"], columns, values),
            kind=about["kind"],
            columns=columns,
            units=units,
            pitch=(size["x"], size["y"]) if size else None,
        )
    return recording


def _values(kind: str, columns: List[str], messages: List[Dict[str, Any]]) -> np.ndarray:
    """Returns the values of a port as one array."""
    if kind in ("image", "vector_image", "mask"):
        return np.stack([_grid(message) for message in messages])
    if kind == "flag":
        return np.array([message["value"] for message in messages], dtype=object)
    if kind == "pose":
        parts = [(message["pose"]["position"], message["pose"]["orientation"]) for message in messages]
        return np.array([[p["x"], p["y"], p["z"], q["x"], q["y"], q["z"], q["w"]] for p, q in parts])
    if kind in ("regions", "jacobian"):
        return np.array([message.get("columns", message.get("regions")) for message in messages] + [None], dtype=object)[:-1]
    keys = [column or "value" for column in columns]
    rows = np.array([[np.nan if message[key] is None else message[key] for key in keys] for message in messages])
    return rows[:, 0] if kind == "scalar" else rows


def _grid(message: Dict[str, Any]) -> np.ndarray:
    """Returns the cells of an image, a vector image or a mask, the first row first."""
    import base64

    data, cols = base64.b64decode(message["data"]), message["column_count"]
    kind = np.uint8 if message["cell_stride"] == 1 else np.dtype("<f4")
    axes = len(message["fields"])
    cells = np.frombuffer(data, kind).reshape((-1, cols, axes) if axes > 1 else (-1, cols))
    return cells.astype(bool) if kind is np.uint8 else cells
