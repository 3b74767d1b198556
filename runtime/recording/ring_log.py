"""The ring log: firings as CSV, which a script can write and a spreadsheet can open.

Such a file may come from any source, so reading checks everything. Each error is one line: the place (file, row as a
text editor counts it, column), what was found there, what is allowed, and what to do.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BufferedReader
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final, TextIO

import numpy as np

from config.errors import WRONG_CALL, UserError
from config.files import open_input
from drivers.messages import CrossPaths, Firing, Pose

REQUIRED: Final = ("t", "x", "y", "theta")
RING_YAW: Final = "ring_yaw"

LINE_MAX_BYTES: Final = 65_536
"""Longest line: ten times the row of the largest ring. Limits the memory that a file without line ends takes."""

_FORM: Final = "the header is t,x,y,theta[,ring_yaw],r00,r01,…[,x00_01,…] separated by commas"
_FINITE: Final = "a finite number"
_RANGE: Final = "metres ≥ 0, 'inf' (fired, no echo) or an empty cell (did not fire)"
_CROSS: Final = re.compile(r"x(\d{2,3})_(\d{2,3})")
"""A column of half paths: transmitter, listener."""
_NAME_PAIRS: Final = "name the pairs of all its cross paths"
_SEPARATORS: Final = MappingProxyType({";": "semicolons", "\t": "tabs", " ": "spaces"})
_NO_NUMBER: Final = frozenset({"", "none", "null", "na", "n/a", "#n/a"})
"""What programs write for a number that they do not have."""
_SPELT_INF: Final = re.compile(r"\s*\+?inf(inity)?\s*", re.IGNORECASE)


class RingLogError(UserError):
    """A ring log cannot be read or written."""

    exit_code = WRONG_CALL


def read_ring_log(path: Path, sensors: int | None = None, *, is_strict: bool = True) -> Iterator[Firing]:
    """Yield the firings of a ring log, one for each row, reading only as far as the caller iterates.

    Parameters
    ----------
    path : Path
        CSV in UTF-8, with or without a byte order mark, LF or CRLF; blank lines are skipped.
    sensors : int, optional
        Number of sensors that the log must have.
    is_strict : bool
        Whether a negative range and the text nan are errors; otherwise they are given as the number and as −inf.

    Raises
    ------
    RingLogError
        The file cannot be read or is invalid; before the first firing if its header is, else at the invalid row.
    """
    try:
        with BufferedReader(open_input(path)) as file:
            yield from _firings(_rows(file, path), path, sensors, _range if is_strict else _any_range)
    except OSError as error:
        raise RingLogError(f"{path}: cannot be read: {error.strerror or error}; check the path") from error


def write_ring_log(path: Path, firings: Iterable[Firing], pairs: Sequence[tuple[int, int]] = ()) -> None:
    """Write firings as a ring log from which `read_ring_log` returns exactly the same values.

    Parameters
    ----------
    path : Path
        Replaced if it exists.
    firings : iterable of Firing
        At least one, all of one ring, in order of time.
    pairs : sequence of tuple
        The cross paths that occur in them, (transmitter, listener); see `drivers.firing_pattern.pattern_pairs`.

    Raises
    ------
    RingLogError
        A firing cannot be represented, or the file cannot be written. The rows before it are in the file.
    """
    try:
        with path.open("w", encoding="utf-8", newline="\n") as file:
            rows = RingLogRows(file, path, pairs)
            for firing in firings:
                rows.write(firing)
                if rows.dropped:
                    raise _error(path, rows.count + 1, "would have a cross path without a column", _NAME_PAIRS)
            rows.check_not_empty()
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path: Path, error: OSError) -> RingLogError:
    """Return the message for a ring log that the disk refuses."""
    return RingLogError(f"{path}: cannot be written: {error.strerror or error}; check the folder and the space left")


def _lines(file: BinaryIO, path: Path) -> Iterator[str]:
    """Yield the file's lines as text; decoded one by one, so that an error can name the row."""
    for row, raw in enumerate(iter(lambda: file.readline(LINE_MAX_BYTES), b""), start=1):
        if len(raw) == LINE_MAX_BYTES:
            raise _error(path, row, f"is longer than {LINE_MAX_BYTES} bytes", "check that this is a ring log (CSV)")
        if b"\0" in raw:
            raise _error(path, row, "holds NUL bytes, as binary files and UTF-16 do", "save it as CSV in UTF-8")
        try:
            yield raw.decode("utf-8-sig" if row == 1 else "utf-8")
        except UnicodeDecodeError as error:
            bad = f"0x{raw[error.start]:02x} at byte {error.start + 1}"
            raise _error(path, row, f"is not UTF-8 ({bad})", "save it as CSV in UTF-8") from error


def _rows(file: BinaryIO, path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row that is not blank, with its number.

    Each line is parsed by itself. A quoted cell may span lines in CSV but not here: a missing quote would otherwise
    read the whole rest of the file into memory as a single row.
    """
    for row, line in enumerate(_lines(file, path), start=1):
        try:
            cells = next(csv.reader((line,), strict=True))
        except csv.Error as error:
            hint = "save it with plain cells and LF or CRLF line ends"
            raise _error(path, row, f"is not CSV ({error})", hint) from error
        if cells:
            yield row, cells


def _firings(
    rows: Iterator[tuple[int, list[str]]], path: Path, sensors: int | None, parse: Callable[[str], float]
) -> Iterator[Firing]:
    header_row, header = next(rows, (1, None))
    if header is None:
        raise RingLogError(f"{path}: is empty; {_FORM}")
    names = [name.strip() for name in header]
    first_range, first_cross, pairs = _check_header(names, path, header_row)
    count = first_cross - first_range
    if sensors is not None and count != sensors:
        raise RingLogError(
            f"{path}: has {count} sensor columns (r00 to {names[first_cross - 1]}), but the robot's ring has "
            f"{sensors} sensors; name the robot file of the robot that recorded the log"
        )
    last_t, empty = -math.inf, True
    for row, cells in rows:
        if len(cells) != len(names):
            raise _error(path, row, f"has {len(cells)} cells where the header has {len(names)}", _cells_hint(cells))
        try:
            stamp = [_finite(cell) for cell in cells[:first_range]]
            ranges = np.array([parse(cell) for cell in cells[first_range:first_cross]], dtype=np.float64)
            heard = _cross_paths(pairs, cells[first_cross:]) if pairs else None
        except ValueError as error:
            raise _cell_error(path, row, names, cells, first_range, parse) from error
        t, x, y, theta = stamp[:4]
        if t < last_t:
            hint = "t never decreases; sort the rows by t, or split the file where the clock restarted"
            raise _error(path, row, f"column 't' is {t!r}, earlier than {last_t!r} before it", hint)
        yield Firing(t, Pose(x, y, theta), stamp[-1], ranges, heard)
        last_t, empty = t, False
    if empty:
        raise RingLogError(f"{path}: holds no firing, only a header; add a row for each firing")


def _cross_paths(pairs: Sequence[tuple[int, int]], cells: Sequence[str]) -> CrossPaths | None:
    """Return what a row's listeners heard, in the order of their indices; None if none listened."""
    heard = sorted(
        (listener, transmitter, half_path_m)
        for (transmitter, listener), half_path_m in zip(pairs, map(_range, cells), strict=True)
        if not math.isnan(half_path_m)
    )
    if not heard:
        return None
    listeners, transmitters, half_paths_m = zip(*heard, strict=True)
    return CrossPaths(np.array(transmitters), np.array(listeners), np.array(half_paths_m))


def _check_header(names: Sequence[str], path: Path, row: int) -> tuple[int, int, list[tuple[int, int]]]:
    """Return the columns at which ranges and half paths begin, and the pair of sensors of each of the latter."""
    for mark, what in _SEPARATORS.items():
        if len(names) == 1 and "theta" in names[0].split(mark):
            hint = f"separate them by commas, and write decimals with a point; {_FORM}"
            raise _error(path, row, f"separates its columns by {what}", hint)
    if any(names) and all(not name or _is_number(name) for name in names):
        raise _error(path, row, "holds numbers where the header belongs", f"write it above them; {_FORM}")
    for name, times in Counter(names).items():
        if times > 1:
            raise _error(path, row, f"names the column {_shown(name)} {times} times", f"each name once; {_FORM}")
    for name in REQUIRED:
        if name not in names:
            raise _error(path, row, f"lacks the column {name!r}", _FORM)
    lead = [*REQUIRED, RING_YAW] if RING_YAW in names else [*REQUIRED]
    first_cross = next(
        (i for i, name in enumerate(names) if i > len(lead) and name.startswith("x") and name != "x"), len(names)
    )
    count = first_cross - len(lead)
    if count == 0:
        raise _error(path, row, "has no sensor column", _FORM)
    wanted = lead + [f"r{i:02d}" for i in range(count)]
    pairs = []
    for name in names[first_cross:]:
        found = _CROSS.fullmatch(name)
        transmitter, listener = (int(found[1]), int(found[2])) if found else (0, 0)
        if (
            transmitter == listener
            or max(transmitter, listener) >= count
            or name != cross_column(transmitter, listener)
        ):
            hint = (
                f"half paths come last, x00_01 for that of sensor 0's pulse to sensor 1, of sensors 0 to {count - 1}"
            )
            raise _error(path, row, f"has the column {_shown(name)}", f"{hint}; {_FORM}")
        pairs.append((transmitter, listener))
    for i, (name, want) in enumerate(zip(names[:first_cross], wanted, strict=True)):
        if name != want:
            raise _error(path, row, f"has {_shown(name)} as column {i + 1} where {want!r} belongs", _FORM)
    return len(lead), first_cross, pairs


def cross_column(transmitter: int, listener: int) -> str:
    """Return the name of the column of half the path from one sensor to another."""
    return f"x{transmitter:02d}_{listener:02d}"


def _number(cell: str) -> float:
    """Return the number in a cell; `float` alone would also accept 1_000 and digits of other scripts."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _finite(cell: str) -> float:
    value = _number(cell)
    if not math.isfinite(value):
        raise ValueError(cell)
    return value


def _range(cell: str) -> float:
    if not cell:
        return math.nan
    value = _number(cell)
    # 1e999 overflows to inf but does not mean "no echo". NaN compares false and is refused as well.
    if not value >= 0.0 or (value == math.inf and _SPELT_INF.fullmatch(cell) is None):
        raise ValueError(cell)
    return value


def _any_range(cell: str) -> float:
    """Return a range in any convention: negative ones as they are, and −inf for the text nan."""
    value = _number(cell) if cell else math.nan
    if value == -math.inf or (value == math.inf and _SPELT_INF.fullmatch(cell) is None):
        raise ValueError(cell)
    return -math.inf if cell and math.isnan(value) else value


def _is_number(cell: str) -> bool:
    return not _is_refused(_number, cell)


def _is_refused(parse: Callable[[str], float], cell: str) -> bool:
    try:
        parse(cell)
    except ValueError:
        return True
    return False


def _cell_error(
    path: Path, row: int, names: Sequence[str], cells: Sequence[str], first_range: int, parse: Callable[[str], float]
) -> RingLogError:
    """Return the error for the first invalid cell of a row that has one."""
    parsers = (
        (_finite if i < first_range else _range if names[i].startswith("x") else parse) for i in range(len(cells))
    )
    column = next(i for i, (of, cell) in enumerate(zip(parsers, cells, strict=True)) if _is_refused(of, cell))
    cell, is_stamp = cells[column], column < first_range
    allowed, action = (_FINITE if is_stamp else _RANGE), "correct or delete the row"
    if not _is_refused(parse, cell.replace(",", ".")):
        action = "write decimals with a point, and nothing between thousands"
    elif names[column] == "t" and cell.count(":") > 0:
        action = "write the time in seconds, from any start, as 1764354000.25"
    elif not is_stamp and cell.strip(" -+.").casefold() in _NO_NUMBER:
        action = "write one of these in its place, in the whole file"
    found = f"is {_shown(cell)}" if cell else "is empty"
    return _error(path, row, f"column {names[column]!r} {found}", f"allowed is {allowed}; {action}")


def _cells_hint(cells: Sequence[str]) -> str:
    if len(cells) == 1 and ";" in cells[0]:
        return "separate the cells by commas and write decimals with a point"
    return "a sensor that did not fire keeps its comma; complete the row, or delete it where the file was cut off"


def _shown(text: str) -> str:
    """Return a cell as a short printable part of a message."""
    shown = ascii(text[:60])
    return shown if len(shown) <= 60 else f"{shown[:60]}…"


def _error(path: Path, row: int, what: str, hint: str) -> RingLogError:
    return RingLogError(f"{path}: row {row} {what}; {hint}")


class RingLogRows:
    """Writer of a ring log's rows into an open text file.

    Parameters
    ----------
    file : TextIO
        Opened for UTF-8 and LF.
    path : Path
        Its name, for messages.
    pairs : sequence of tuple
        The cross paths that get a column, (transmitter, listener).

    Attributes
    ----------
    count : int
        Firings written so far.
    dropped : int
        Cross paths left out because they have no column.
    """

    def __init__(self, file: TextIO, path: Path, pairs: Sequence[tuple[int, int]] = ()) -> None:
        self._file = file
        self._path = path
        self._pairs = tuple(pairs)
        self.count = 0
        self.dropped = 0
        self._sensors = 0
        self._last_t = -math.inf

    def write(self, firing: Firing) -> None:
        """Write a row, and before the first one the header.

        Raises
        ------
        RingLogError
            The firing cannot be represented: another number of sensors, a time before the last one, a bad number.
        OSError
            The disk refuses.
        """
        path, row = self._path, self.count + 2
        ranges = firing.ranges_m.tolist()
        if self.count == 0:
            self._sensors = len(ranges)
            columns = [*(f"r{i:02d}" for i in range(self._sensors)), *(cross_column(*pair) for pair in self._pairs)]
            self._file.write(",".join([*REQUIRED, RING_YAW, *columns]) + "\n")
        stamp = [firing.robot_s, firing.pose.x, firing.pose.y, firing.pose.theta, firing.ring_yaw]
        if len(ranges) != self._sensors or not ranges:
            expected = f"the first firing has {self._sensors}, at least 1"
            raise _error(path, row, f"would have {len(ranges)} sensors", expected)
        if not all(map(math.isfinite, stamp)) or firing.robot_s < self._last_t:
            expected = f"all are finite and t ≥ {self._last_t}"
            raise _error(path, row, f"would have t, pose and ring yaw {stamp}", expected)
        if any(r < 0.0 for r in ranges):
            raise _error(path, row, f"would have the range {min(ranges)}", f"allowed is {_RANGE}")
        ranges += self._half_paths(firing.cross_paths)
        cells = [repr(float(value)) for value in stamp] + ["" if math.isnan(r) else repr(r) for r in ranges]
        self._file.write(",".join(cells) + "\n")
        self._last_t = firing.robot_s
        self.count += 1

    def _half_paths(self, heard: CrossPaths | None) -> list[float]:
        """Return a number for each column of half paths, NaN where the sensor did not listen."""
        if heard is None:
            return [math.nan] * len(self._pairs)
        pairs = zip(heard.transmitters.tolist(), heard.listeners.tolist(), strict=True)
        found = dict(zip(pairs, heard.half_paths_m.tolist(), strict=True))
        self.dropped += len(found.keys() - set(self._pairs))
        return [found.get(pair, math.nan) for pair in self._pairs]

    def check_not_empty(self) -> None:
        """Refuse a ring log without a firing.

        Raises
        ------
        RingLogError
            No row was written.
        """
        if self.count == 0:
            raise RingLogError(f"{self._path}: there is no firing to write; a ring log holds at least one")
