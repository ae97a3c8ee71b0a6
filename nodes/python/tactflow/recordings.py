"""Recordings of runs as arrays."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np


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
    """Names of the numbers of a row: those of features, and `vx`, `vy`, ... of a twist. An empty text for a single
    number."""
    units: List[str]
    """Unit of each number of a row; one for the whole image."""
    pitch: Optional[Tuple[float, float]] = None
    """Of an image or a mask: the distance between the centres of two tactels along x and y [m]."""
    lost: Sequence[float] = ()
    """Times at which an image, a mask or a pose became absent [s]. Other kinds have an absent value then."""


class Recording(Dict[str, Series]):
    """The ports of a recording by name. ``info`` is what the recording states of the run."""

    info: Dict[str, Any]


def open(path: str) -> Recording:  # noqa: A001
    """Reads a recording of a run (``tactflow run --record``) into arrays by the names of the ports."""
    try:
        from mcap.reader import make_reader
    except ImportError:
        raise ImportError("a recording needs the package `mcap`: install it with `pip install mcap`") from None
    import builtins

    recording = Recording()
    recording.info = {}
    lost: Dict[str, List[float]] = {}
    raw: Dict[str, Tuple[Dict[str, str], List[int], List[Any]]] = {}
    with builtins.open(path, "rb") as stream:
        reader = make_reader(stream)
        for metadata in reader.iter_metadata():
            recording.info[metadata.name] = dict(metadata.metadata)
        for _, channel, message in reader.iter_messages():
            if channel.topic == "/tactflow/lost":
                lost.setdefault(json.loads(message.data)["port"], []).append(message.log_time * 1e-9)
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
            lost=lost.get(name, ()),
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
        rows = [message.get("columns", message.get("regions")) for message in messages]
        return np.array(rows + [None], dtype=object)[:-1]
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
