"""Kinds of ports, and nodes: functions whose annotations name them."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any, Callable, Dict, Optional, Tuple, Union

import numpy as np

VERSION = 1
"""Version of the protocol."""

TIMELESS = 2**63 - 1
"""Stamp of what was computed from no sample."""


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
class ParamUnit:
    unit: Optional[str]
    doc: str = ""


class _Param:
    """``Param["N"]`` is a parameter in that unit. Its default is that of the argument of the function."""

    def __getitem__(self, argument: Union[str, Tuple[str, str]]) -> ParamUnit:
        unit, doc = argument if isinstance(argument, tuple) else (argument, "")
        return ParamUnit(unit, doc)


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
"""Features: an input is ``Features()``, and an output ``Features(x="m")``. Values are dictionaries; an absent number is
None."""


@dataclass
class Frame:
    """An image of a pad, as an array without a copy. The array is read-only."""

    cells: np.ndarray
    """The values, row by row: ``float32``. Those of a vector image have a third axis: x, y and z."""
    pitch: Tuple[float, float] = (1.0, 1.0)
    """Distance between the centres of two tactels along x and y [m]."""
    unit: str = "raw"
    """Unit of the values."""
    stamp: int = TIMELESS
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
    params: Dict[str, Tuple[float, ParamUnit]]
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
    """Makes a node of a function: its arguments are inputs and parameters, and its annotation of what it returns names
    the outputs. An argument that is called ``stamp`` gets the oldest time of the new inputs [ns]."""
    annotations = _annotations(function)
    inputs: Dict[str, Port] = {}
    params: Dict[str, Tuple[float, ParamUnit]] = {}
    wants_stamp = False
    for name, argument in inspect.signature(function).parameters.items():
        annotation = annotations.get(name)
        if name == "stamp" and annotation in (None, int):
            wants_stamp = True
        elif isinstance(annotation, Port):
            inputs[name] = annotation
        elif isinstance(annotation, ParamUnit) or annotation is Param:
            if argument.default is inspect.Parameter.empty:
                raise TypeError(f"the parameter `{name}` of `{function.__name__}` needs a default")
            unit = annotation if isinstance(annotation, ParamUnit) else ParamUnit(None)
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
