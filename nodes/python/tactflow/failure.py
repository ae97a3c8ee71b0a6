"""Exceptions of a program: the last line of its standard error, which tactflow shows, names the line at fault."""

from __future__ import annotations

import os
import sys
import traceback
from contextlib import contextmanager
from types import CodeType
from typing import Iterator, Optional

MAX_SHOWN = 300
"""Number of characters of a line that tactflow shows."""

_PACKAGE = os.path.dirname(os.path.abspath(__file__))


@contextmanager
def naming_the_line(code: Optional[CodeType]) -> Iterator[None]:
    """Ends the program when its part raises. ``code`` is that part: it stands for what it returns, if that is wrong."""
    try:
        yield
    except KeyboardInterrupt:
        pass
    except Exception as error:
        if isinstance(error, BrokenPipeError) and _is_of_the_package(_deepest(error)):
            # Whoever reads what this program writes is gone.
            return
        print(_report(error, code), file=sys.stderr, flush=True)
        sys.exit(1)


def _deepest(error: Exception) -> str:
    """Returns the file whose line raised an error."""
    return os.path.abspath(traceback.extract_tb(error.__traceback__)[-1].filename)


def _report(error: Exception, code: Optional[CodeType]) -> str:
    """Returns the traceback, with the place at fault at the end of its last line."""
    trace = error.__traceback__
    while trace and _is_of_the_package(os.path.abspath(trace.tb_frame.f_code.co_filename)):
        trace = trace.tb_next
    # What the package finds in a result has no line of the user, and keeps its own.
    text = "".join(traceback.format_exception(type(error), error, trace or error.__traceback__)).rstrip()
    place = _place(error, code)
    if not place:
        return text
    before, _, last = text.rpartition("\n")
    most = MAX_SHOWN - len(place) - 3
    if len(last) > most:
        # The whole text stays above, because tactflow cuts a longer line at its end.
        before, last = text, last[: most - 3] + "..."
    return f"{before}\n{last} ({place})"


def _place(error: Exception, code: Optional[CodeType]) -> Optional[str]:
    """Returns the file of the user and its line: the deepest one in the folder of the program."""
    frames = [(os.path.abspath(frame.filename), frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    if code is None:
        first = next((path for path, _ in frames if not _is_of_the_package(path)), None)
    else:
        first = os.path.abspath(code.co_filename)
    if first is None:
        return None
    folder = os.path.dirname(first)
    own = [(path, line) for path, line in frames if _is_in(folder, path) and not _is_of_the_package(path)]
    if own:
        path, line = own[-1]
        return f"{os.path.relpath(path, folder)}, line {line}"
    return f"{os.path.basename(first)}, line {code.co_firstlineno}" if code else None


def _is_in(folder: str, path: str) -> bool:
    return path.startswith(os.path.join(folder, "")) and "site-packages" not in path[len(folder) :]


def _is_of_the_package(path: str) -> bool:
    return os.path.dirname(path) == _PACKAGE
