"""Where the inputs of a node come from when it runs alone: the ports of a recording, or the arrays of an archive."""

from __future__ import annotations

import json
import zipfile
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Optional, Tuple

import numpy as np

from .ports import Frame, Port
from .recordings import Series, open as open_recording

IMAGES = ("image", "vector_image")
_TWIST = ["vx", "vy", "vz", "wx", "wy", "wz"]


@dataclass
class Candidate:
    """A port of a recording, or what an array of an archive can be."""

    kinds: Tuple[str, ...]
    unit: Optional[str]
    """Unit of an image or a number; None if the file does not state it."""
    load: Callable[[], Series]

    def fits(self, port: Port) -> bool:
        """Whether an input takes it."""
        return port.kind in self.kinds and (None in (port.unit, self.unit) or port.unit == self.unit)

    def describe(self) -> str:
        """Returns its kind and its unit in words."""
        return in_words(self.kinds, self.unit)


@dataclass
class Source:
    """A file with values for inputs."""

    path: str
    candidates: Dict[str, Candidate]
    states_units: bool = True
    states_pitch: bool = True
    has_times: bool = True
    noun: str = "port"

    def choose(self, name: str, port: Port, wire: Optional[str]) -> str:
        """Returns the port for an input: that of its wire, or the only one with its name that the input takes.

        Raises ``SystemExit`` with the ports that the input takes.
        """
        wanted = wire or name
        named = [one for one in self.candidates if one == wanted]
        named = named or [one for one in self.candidates if one.endswith("." + wanted)]
        fitting = [one for one in named if self.candidates[one].fits(port)]
        if len(fitting) == 1:
            return fitting[0]
        takes, noun = in_words((port.kind,), port.unit), self.noun
        if fitting:
            what = f"has {len(fitting)} {noun}s `{wanted}` for the input `{name}`, which takes {takes}"
        elif not named:
            what = f"has no {noun} `{wanted}`, and the input `{name}` takes {takes}"
        else:
            found = " and ".join(f"`{one}`, which is {self.candidates[one].describe()}" for one in sorted(named))
            what = f"has {found}, but the input `{name}` takes {takes}"
        others = sorted(fitting or [one for one, candidate in self.candidates.items() if candidate.fits(port)])
        if not others:
            raise SystemExit(f"{self.path} {what}: no {noun} in it has this kind and this unit")
        units = [self.candidates[one].unit for one in others]
        known = ", ".join(f"{one} [{unit}]" if port.unit and unit else one for one, unit in zip(others, units))
        raise SystemExit(f"{self.path} {what}: write `--wire {name}={noun.upper()}` with one of {known}")


def in_words(kinds: Tuple[str, ...], unit: Optional[str]) -> str:
    """Returns kinds and a unit in words: `an image in N`."""
    articles = {"features": "features", "joints": "joints", "image": "an image"}
    words = " or ".join(articles.get(kind, f"a {kind.replace('_', ' ')}") for kind in kinds)
    return words if unit is None or not {"scalar", *IMAGES} & set(kinds) else f"{words} in {unit}"


def recorded(path: str) -> Source:
    """Returns the ports of a recording."""
    recording = open_recording(path)

    def candidate(series: Series) -> Candidate:
        unit = series.units[0] if series.units and series.kind in ("scalar", *IMAGES) else None
        return Candidate((series.kind,), unit, lambda: series)

    return Source(path, {name: candidate(series) for name, series in recording.items()})


def archived(path: str, pitch: float) -> Source:
    """Returns the arrays of an archive: those of `tactflow export` by the names of their ports, or any others."""
    sizes = _sizes(path)
    archive = np.load(path)
    about = json.loads(str(archive["about"])) if sizes.get("about") == () else {}
    units: Dict[str, str] = about.get("units", {})
    has_times = len(sizes.get("time", ())) == 1
    candidates: Dict[str, Candidate] = {}
    groups: Dict[str, List[str]] = {}

    def series(names: List[str], columns: List[str]) -> Series:
        arrays = [archive[name] for name in names]
        lengths = {len(array) for array in arrays}
        if has_times and lengths != {len(archive["time"])}:
            held = ", ".join(f"{len(array)} of `{name}`" for name, array in zip(names, arrays))
            raise SystemExit(f"{path} has {len(archive['time'])} times, and {held}")
        times = archive["time"] if has_times else np.arange(len(arrays[0]), dtype=float)
        values = arrays[0] if not columns else np.stack(arrays, axis=1)
        return Series(times, values, "", columns, [units.get(name, "") for name in names], (pitch, pitch))

    for name, size in sizes.items():
        if not size or name == "time":
            continue
        unit = units.get(name)
        candidates[name] = Candidate(_kinds(len(size), unit), unit, lambda name=name: series([name], []))
        if len(size) == 1 and about and "." in name:
            groups.setdefault(name.rpartition(".")[0], []).append(name)
    for port, names in groups.items():
        columns = [name.rpartition(".")[2] for name in names]
        kinds = ("twist",) if columns == _TWIST else ("features", "joints")
        load = lambda names=names, columns=columns: series(names, columns)  # noqa: E731
        candidates.setdefault(port, Candidate(kinds, None, load))
    noun = "port" if about else "array"
    return Source(path, candidates, bool(units), False, has_times, noun)


def _kinds(axes: int, unit: Optional[str]) -> Tuple[str, ...]:
    """Returns what an array with these axes can be. The first axis is the time, and flags and masks have the unit 1."""
    kinds = {1: ("scalar", "flag"), 2: ("twist", "joints"), 3: ("image", "mask"), 4: ("vector_image",)}.get(axes, ())
    return kinds if unit in (None, "1") else tuple(kind for kind in kinds if kind not in ("flag", "mask"))


def _sizes(path: str) -> Dict[str, Tuple[int, ...]]:
    """Returns the shape of each array of an archive, without its values."""
    sizes = {}
    with zipfile.ZipFile(path) as archive:
        for name in archive.namelist():
            with archive.open(name) as file:
                version = np.lib.format.read_magic(file)
                read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
                sizes[name[: -len(".npy")] if name.endswith(".npy") else name] = read(file)[0]
    return sizes


def newest_at(series: Series, times: np.ndarray) -> np.ndarray:
    """Returns the place of the newest value at each time; -1 where it is lost, or where there is none yet."""
    newest = np.searchsorted(series.times, times, side="right") - 1
    if not len(series.lost):
        return newest
    last_lost = np.concatenate([[-np.inf], series.lost])[np.searchsorted(series.lost, times, side="right")]
    return np.where((newest >= 0) & (series.times[newest] < last_lost), -1, newest)


def value_at(series: Series, at: int, port: Port) -> Any:
    """Returns a value as a node gets it in a graph: NaN in the file is an absent value, and so is what is not there."""
    one = None if at < 0 else series.values[at]
    if one is None:
        return None
    if port.kind == "flag":
        return None if _is_nan(one) else bool(one)
    if port.kind == "features":
        parts = {name: None if np.isnan(part) else float(part) for name, part in zip(series.columns, one)}
        return None if all(part is None for part in parts.values()) else parts
    if port.kind == "scalar":
        return None if _is_nan(one) else float(one)
    if port.kind == "mask":
        return None if np.asarray(one).dtype.kind == "f" and np.isnan(one).all() else np.asarray(one).astype(bool)
    if port.kind in IMAGES:
        cells, unit = np.asarray(one, np.float32), (series.units or [""])[0] or port.unit or "raw"
        stamp = int(round(float(series.times[at]) * 1e9))
        return None if np.isnan(cells).all() else Frame(cells, series.pitch or (1.0, 1.0), unit, stamp)
    return None if np.isnan(one).any() else one


def _is_nan(number: Any) -> bool:
    return bool(number != number)
