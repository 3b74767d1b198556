"""The ring log: firings as CSV, which a script can write and a spreadsheet can open.

Such a file may come from any source, so reading checks everything. Each error is one line: the place (file, row as a
text editor counts it, column), what was found there, what is allowed, and what to do.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from io import BufferedReader
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final

import numpy as np

from config.errors import WRONG_CALL, UserError
from config.files import open_input
from drivers.messages import CrossPaths, Firing, Pose
from runtime.recording.servo_columns import COLUMN, HINT, ServoColumns

REQUIRED: Final = ("t", "x", "y", "theta")
RING_YAW: Final = "ring_yaw"

LINE_MAX_BYTES: Final = 65_536
"""Longest line: ten times the row of the largest ring. Limits the memory that a file without line ends takes."""

_FORM: Final = "the header is t,x,y,theta[,ring_yaw],r00,r01,…[,x00_01,…] separated by commas"
_FINITE: Final = "a finite number"
RANGE_ALLOWED: Final = "metres ≥ 0, 'inf' (fired, no echo) or an empty cell (did not fire)"
_CROSS: Final = re.compile(r"x(\d{2,3})_(\d{2,3})")
"""A column of half paths: transmitter, listener."""
_SEPARATORS: Final = MappingProxyType({";": "semicolons", "\t": "tabs", " ": "spaces"})
_PACKED: Final = MappingProxyType(
    {b"\x1f\x8b": "gzip", b"PK": "zip, or a spreadsheet as xlsx", b"BZh": "bzip2", b"\xfd7zXZ": "xz"}
)
"""How files begin that hold others."""
_NO_NUMBER: Final = frozenset({"", "none", "null", "na", "n/a", "#n/a"})
"""What programs write for a number that they do not have."""
_SPELT_INF: Final = re.compile(r"\s*\+?inf(inity)?\s*", re.IGNORECASE)


class RingLogError(UserError):
    """A ring log cannot be read or written."""

    exit_code = WRONG_CALL


def read_ring_log(
    path: Path, sensors: int | None = None, *, is_strict: bool = True, servos: ServoColumns | None = None
) -> Iterator[Firing]:
    """Yield the firings of a ring log, one for each row, reading only as far as the caller iterates.

    Parameters
    ----------
    path : Path
        CSV in UTF-8, with or without a byte order mark, LF or CRLF; blank lines are skipped.
    sensors : int, optional
        Number of sensors that the log must have.
    is_strict : bool
        Whether a negative range and the text nan are errors; otherwise they are given as the number and as −inf.
    servos : ServoColumns, optional
        The bearings that the log must have; firings then have a range for each mount of the ring.

    Raises
    ------
    RingLogError
        The file cannot be read or is invalid; before the first firing if its header is, else at the invalid row.
    """
    try:
        with BufferedReader(open_input(path)) as file:
            yield from _firings(_rows(file, path), path, sensors, _range if is_strict else _any_range, servos)
    except OSError as error:
        raise RingLogError(f"{path}: cannot be read: {error.strerror or error}; check the path") from error


def _lines(file: BinaryIO, path: Path) -> Iterator[str]:
    """Yield the file's lines as text; decoded one by one, so that an error can name the row.

    Raises
    ------
    RingLogError
        A line is too long, or no text in UTF-8.
    """
    for row, raw in enumerate(iter(lambda: file.readline(LINE_MAX_BYTES), b""), start=1):
        if len(raw) == LINE_MAX_BYTES:
            raise row_error(
                path, row, f"is longer than {LINE_MAX_BYTES} bytes", "check that this is a ring log (CSV)"
            )
        if row == 1 and (packed := next((name for magic, name in _PACKED.items() if raw.startswith(magic)), None)):
            raise row_error(path, row, f"is compressed ({packed})", "unpack the file first")
        if b"\0" in raw:
            raise row_error(path, row, "holds NUL bytes, as binary files and UTF-16 do", "save it as CSV in UTF-8")
        try:
            yield raw.decode("utf-8-sig" if row == 1 else "utf-8")
        except UnicodeDecodeError as error:
            bad = f"0x{raw[error.start]:02x} at byte {error.start + 1}"
            raise row_error(path, row, f"is not UTF-8 ({bad})", "save it as CSV in UTF-8") from error


def _rows(file: BinaryIO, path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row that is not blank, with its number.

    Each line is parsed by itself. A quoted cell may span lines in CSV but not here: a missing quote would otherwise
    read the whole rest of the file into memory as a single row.

    Raises
    ------
    RingLogError
        A row is not CSV.
    """
    for row, line in enumerate(_lines(file, path), start=1):
        try:
            cells = next(csv.reader((line,), strict=True))
        except csv.Error as error:
            hint = "save it with plain cells and LF or CRLF line ends"
            raise row_error(path, row, f"is not CSV ({error})", hint) from error
        if cells:
            yield row, cells


def _firings(
    rows: Iterator[tuple[int, list[str]]],
    path: Path,
    sensors: int | None,
    parse: Callable[[str], float],
    servos: ServoColumns | None,
) -> Iterator[Firing]:
    """Yield the firing of each row after the header, as it is read; `servos` turns bearings into mounts.

    Raises
    ------
    RingLogError
        The header or a row is invalid; firings before it have been yielded by then.
    """
    header_row, header = next(rows, (1, None))
    if header is None:
        raise RingLogError(f"{path}: is empty; {_FORM}")
    names = [name.strip() for name in header]
    angles = servos.names if servos is not None else []
    first_range, first_angle, pairs = _check_header(names, path, header_row, angles)
    count, first_cross = first_angle - first_range, first_angle + len(angles)
    if sensors is not None and count != sensors:
        raise RingLogError(
            f"{path}: has {count} sensor columns (r00 to {names[first_angle - 1]}), but the robot's ring has "
            f"{sensors} sensors; name the robot file of the robot that recorded the log"
        )
    last_t, empty = -math.inf, True
    for row, cells in rows:
        if len(cells) != len(names):
            raise row_error(
                path, row, f"has {len(cells)} cells where the header has {len(names)}", _cells_hint(cells)
            )
        try:
            stamp = [_finite(cell) for cell in cells[:first_range]]
            ranges = np.array([parse(cell) for cell in cells[first_range:first_angle]], dtype=np.float64)
            bearings = [_finite(cell) if cell else math.nan for cell in cells[first_angle:first_cross]]
            heard = _cross_paths(pairs, cells[first_cross:]) if pairs else None
        except ValueError as error:
            raise _cell_error(path, row, names, cells, first_range, parse) from error
        if servos is not None and angles:
            try:
                ranges = servos.mounts(ranges, bearings)
            except ValueError as error:
                raise row_error(path, row, str(error), HINT) from error
        t, x, y, theta = stamp[:4]
        if t < last_t:
            hint = "t never decreases; sort the rows by t, or split the file where the clock restarted"
            raise row_error(path, row, f"column 't' is {t!r}, earlier than {last_t!r} before it", hint)
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


def _check_header(
    names: Sequence[str], path: Path, row: int, angles: Sequence[str]
) -> tuple[int, int, list[tuple[int, int]]]:
    """Return the columns at which ranges begin and end, and the pair of sensors of each column of half paths.

    Raises
    ------
    RingLogError
        It is none of this ring; the text says what is wrong.
    """
    _check_names(names, path, row)
    lead = [*REQUIRED, RING_YAW] if RING_YAW in names else [*REQUIRED]
    first_cross = next(
        (i for i, name in enumerate(names) if i > len(lead) and name.startswith("x") and name != "x"), len(names)
    )
    if [name for name in names if COLUMN.fullmatch(name)] != list(angles):
        what = (
            f"lacks the columns {', '.join(angles)}" if angles else "has bearings of a servo, and the ring has none"
        )
        raise row_error(path, row, what, HINT)
    count = first_cross - len(angles) - len(lead)
    if count == 0:
        raise row_error(path, row, "has no sensor column", _FORM)
    wanted = [*lead, *(f"r{i:02d}" for i in range(count)), *angles]
    pairs = [_pair_of(name, count, path, row) for name in names[first_cross:]]
    for i, (name, want) in enumerate(zip(names[:first_cross], wanted, strict=True)):
        if name != want:
            raise row_error(path, row, f"has {_shown(name)} as column {i + 1} where {want!r} belongs", _FORM)
    return len(lead), len(lead) + count, pairs


def _check_names(names: Sequence[str], path: Path, row: int) -> None:
    """Raise an error unless these are names, separated by commas, each once and the required ones among them."""
    for mark, what in _SEPARATORS.items():
        if len(names) == 1 and "theta" in names[0].split(mark):
            hint = f"separate them by commas, and write decimals with a point; {_FORM}"
            raise row_error(path, row, f"separates its columns by {what}", hint)
    if any(names) and all(not name or _is_number(name) for name in names):
        raise row_error(path, row, "holds numbers where the header belongs", f"write it above them; {_FORM}")
    for name, times in Counter(names).items():
        if times > 1:
            raise row_error(path, row, f"names the column {_shown(name)} {times} times", f"each name once; {_FORM}")
    for name in REQUIRED:
        if name not in names:
            raise row_error(path, row, f"lacks the column {name!r}", _FORM)


def _pair_of(name: str, count: int, path: Path, row: int) -> tuple[int, int]:
    """Return the sensors, one of `count` that pings and one that listens, of a column of half paths.

    Raises
    ------
    RingLogError
        It is the name of no such column.
    """
    found = _CROSS.fullmatch(name)
    transmitter, listener = (int(found[1]), int(found[2])) if found else (0, 0)
    if transmitter == listener or max(transmitter, listener) >= count or name != cross_column(transmitter, listener):
        hint = f"half paths come last, x00_01 for that of sensor 0's pulse to sensor 1, of sensors 0 to {count - 1}"
        raise row_error(path, row, f"has the column {_shown(name)}", f"{hint}; {_FORM}")
    return transmitter, listener


def cross_column(transmitter: int, listener: int) -> str:
    """Return the name of the column of half the path from one sensor to another."""
    return f"x{transmitter:02d}_{listener:02d}"


def _number(cell: str) -> float:
    """Return the number in a cell; `float` alone would also accept 1_000 and digits of other scripts.

    Raises
    ------
    ValueError
        It holds none.
    """
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _finite(cell: str) -> float:
    """Return the finite number in a cell.

    Raises
    ------
    ValueError
        It is none.
    """
    value = _number(cell)
    if not math.isfinite(value):
        raise ValueError(cell)
    return value


def _range(cell: str) -> float:
    """Return the range in a cell, m: NaN if it is empty, inf for the text inf.

    Raises
    ------
    ValueError
        It is negative, or no number.
    """
    if not cell:
        return math.nan
    value = _number(cell)
    # 1e999 overflows to inf but does not mean "no echo". NaN compares false and is refused as well.
    if not value >= 0.0 or (value == math.inf and _SPELT_INF.fullmatch(cell) is None):
        raise ValueError(cell)
    return value


def _any_range(cell: str) -> float:
    """Return a range in any convention: negative ones as they are, and −inf for the text nan.

    Raises
    ------
    ValueError
        It is infinite without being written so.
    """
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
        (_finite if i < first_range or (cell and names[i][0] == "h") else _range if names[i][0] == "x" else parse)
        for i, cell in enumerate(cells)
    )
    column = next(i for i, (of, cell) in enumerate(zip(parsers, cells, strict=True)) if _is_refused(of, cell))
    cell, is_stamp = cells[column], column < first_range or names[column][0] == "h"
    allowed, action = (_FINITE if is_stamp else RANGE_ALLOWED), "correct or delete the row"
    if not _is_refused(parse, cell.replace(",", ".")):
        action = "write decimals with a point, and nothing between thousands"
    elif names[column] == "t" and cell.count(":") > 0:
        action = "write the time in seconds, from any start, as 1764354000.25"
    elif not is_stamp and cell.strip(" -+.").casefold() in _NO_NUMBER:
        action = "write one of these in its place, in the whole file"
    found = f"is {_shown(cell)}" if cell else "is empty"
    return row_error(path, row, f"column {names[column]!r} {found}", f"allowed is {allowed}; {action}")


def _cells_hint(cells: Sequence[str]) -> str:
    if len(cells) == 1 and ";" in cells[0]:
        return "separate the cells by commas and write decimals with a point"
    return "a sensor that did not fire keeps its comma; complete the row, or delete it where the file was cut off"


def _shown(text: str) -> str:
    """Return a cell as a short printable part of a message."""
    shown = ascii(text[:60])
    return shown if len(shown) <= 60 else f"{shown[:60]}…"


def row_error(path: Path, row: int, what: str, hint: str) -> RingLogError:
    """Return the error about a row of a file: what is wrong with it, and what to do."""
    return RingLogError(f"{path}: row {row} {what}; {hint}")
