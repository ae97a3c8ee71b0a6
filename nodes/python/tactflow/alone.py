"""``--test``: runs a node alone on a recording or an archive, and prints its outputs as a table."""

from __future__ import annotations

import sys
import time
from typing import Any, Dict, List, Sequence, Set, Tuple

import numpy as np

from .ports import Node
from .protocol import answer_bytes, by_name
from .recordings import Series
from .sources import IMAGES, Source, archived, newest_at, recorded, value_at


def try_alone(what: Node, path: str, wires: Sequence[str], pitch: float) -> int:
    """Prints the outputs for each value of the first input, and how long the function takes. Returns the exit code."""
    chosen = _wires(what, wires)
    source = _open(path, pitch)
    if not source.states_units and any(port.unit for port in what.inputs.values()):
        taken = ", ".join(f"{name} [{port.unit}]" for name, port in what.inputs.items() if port.unit)
        print(f"{path} states no units: its values are taken in the units of the inputs, {taken}", file=sys.stderr)
    ports = {name: source.choose(name, port, chosen.get(name)) for name, port in what.inputs.items()}
    series = {name: source.candidates[of].load() for name, of in ports.items()}
    for name, port in what.inputs.items():
        print(f"{name} = {ports[name]}{_details(source, series[name], port.kind, port.unit)}")
    times = next(iter(series.values())).times
    if not source.has_times:
        times = times[: min(len(one.times) for one in series.values())]
    return _run(what, series, times, source.has_times)


def _wires(what: Node, wires: Sequence[str]) -> Dict[str, str]:
    """Returns the ports that the command line chooses, by their inputs."""
    chosen = {}
    for wire in wires:
        name, _, port = wire.partition("=")
        if not port:
            raise SystemExit(f"`--wire {wire}` names no port: write `--wire {name}=PORT`")
        if name not in what.inputs:
            raise SystemExit(f"`{what.name}` has no input `{name}`: its inputs are {', '.join(what.inputs)}")
        chosen[name] = port
    if not what.inputs:
        raise SystemExit(f"`{what.name}` has no inputs")
    return chosen


def _open(path: str, pitch: float) -> Source:
    if not path.endswith((".mcap", ".npz")):
        raise SystemExit(f"{path} does not end in .mcap or .npz")
    try:
        return recorded(path) if path.endswith(".mcap") else archived(path, pitch)
    except ImportError as error:
        raise SystemExit(str(error)) from None
    except Exception as error:
        raise SystemExit(f"cannot read {path}: {error}") from None


def _details(source: Source, series: Series, kind: str, unit: Any) -> str:
    """Returns the unit of an input and the size of its images, and where the pitch comes from."""
    stated = series.units[0] if series.units and series.units[0] else unit
    text = f" [{stated}]" if stated and kind in ("scalar", *IMAGES) else ""
    if kind in (*IMAGES, "mask") and series.values.ndim > 2:
        x, y = (pitch * 1e3 for pitch in series.pitch or (1.0, 1.0))
        rows, cols = series.values.shape[1:3]
        text += f", {rows}x{cols} tactels, pitch {x:g} mm by {y:g} mm"
        text += "" if source.states_pitch else " (`--pitch`)"
    return text


def _run(what: Node, series: Dict[str, Series], times: np.ndarray, has_times: bool) -> int:
    params = {name: default for name, (default, _) in what.params.items()}
    newest = {name: newest_at(one, times) for name, one in series.items()}
    moments = [f"{moment:.4f}" if has_times else f"{moment:.0f}" for moment in times]
    titles = ["time [s]" if has_times else "frame", *_titles(what)]
    widths = [max(len(title), 11) for title in titles]
    widths[0] = max(len(text) for text in [titles[0], *moments])
    print(_line(titles, widths))
    durations: List[float] = []
    bad: Set[str] = set()
    for i, moment in enumerate(moments):
        values = {name: value_at(series[name], newest[name][i], port) for name, port in what.inputs.items()}
        more = {"stamp": int(round(float(times[i]) * 1e9)) if has_times else i} if what.wants_stamp else {}
        begin = time.perf_counter()
        result = what.function(**values, **params, **more)
        durations.append(time.perf_counter() - begin)
        answer_bytes(what.outputs, result)
        row = _row(what, by_name(what.outputs, result))
        print(_line([moment, *(text for _, text, _ in row)], widths))
        for name, text, is_finite in row:
            if not is_finite and name not in bad:
                bad.add(name)
                when = f"at {moment} s" if has_times else f"in frame {moment}"
                _warn_of(name, text, when)
    if not durations:
        raise SystemExit("there is no value of any input")
    middle, late = np.percentile(np.array(durations) * 1e3, [50, 99])
    print(f"{len(times)} frames; {middle:.3f} ms each, and {late:.3f} ms for the slowest in a hundred")
    return 1 if bad else 0


def _warn_of(name: str, text: str, when: str) -> None:
    sys.stdout.flush()
    message = f"output `{name}` is not finite {when} ({text}): return None for an absent value"
    print(f"{message}; in a graph, the policy `not_finite` ends the run by default", file=sys.stderr, flush=True)


def _titles(what: Node) -> List[str]:
    """Returns the titles of the columns: each output, or each of its features, with its unit."""
    titles = []
    for name, port in what.outputs.items():
        parts = [(f"{name}.{part}", unit) for part, unit in port.features] or [(name, port.unit)]
        titles.extend(f"{part} [{unit}]" if unit else part for part, unit in parts)
    return titles


def _row(what: Node, values: Dict[str, Any]) -> List[Tuple[str, str, bool]]:
    """Returns the name of each column, its text, and whether its value is finite."""
    row = []
    for name, port in what.outputs.items():
        value = values.get(name)
        if port.kind == "features":
            parts = [(f"{name}.{part}", (value or {}).get(part)) for part, _ in port.features]
        else:
            parts = [(name, value)]
        row.extend((part, *_cell(port.kind, one)) for part, one in parts)
    return row


def _cell(kind: str, value: Any) -> Tuple[str, bool]:
    """Returns a value as text, and whether it is finite."""
    if value is None:
        return "-", True
    if kind == "flag":
        return ("true" if value else "false"), True
    if kind in IMAGES:
        cells = np.asarray(getattr(value, "cells", value), np.float64)
        return f"{cells.min():.4g} to {cells.max():.4g}", bool(np.isfinite(cells).all())
    return f"{float(value):.6g}", bool(np.isfinite(float(value)))


def _line(texts: Sequence[str], widths: Sequence[int]) -> str:
    return "  ".join(text.ljust(width) for text, width in zip(texts, widths)).rstrip()
