"""The ring log: a recording of firings that any robot's owner can write with a script and read in a spreadsheet.

Such files come from strangers, so reading trusts nothing and every complaint is one line that says where (file, row
as a text editor counts it, column), what stood there, what is allowed, and what to do.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO, Final, TextIO

import numpy as np

from config.errors import WRONG_CALL, UserError
from drivers.messages import Firing, Pose

REQUIRED: Final = ("t", "x", "y", "theta")
RING_YAW: Final = "ring_yaw"

LINE_MAX_BYTES: Final = 65_536
"""Ten times the row of the largest ring; a longer line is no ring log and must not fill the memory."""

_FORM: Final = "the header is t,x,y,theta[,ring_yaw],r00,r01,… separated by commas"
_FINITE: Final = "a finite number"
_RANGE: Final = "metres ≥ 0, 'inf' for fired and heard nothing, or nothing for did not fire"
_SPELT_INF: Final = re.compile(r"\s*\+?inf(inity)?\s*", re.IGNORECASE)


class RingLogError(UserError):
    """The ring log cannot be read or written; the text is one line for the user."""

    exit_code = WRONG_CALL


def read_ring_log(path: Path, sensors: int | None = None) -> Iterator[Firing]:
    """Yield the firings of a ring log, one a row, reading no further than asked.

    Parameters
    ----------
    path
        CSV in UTF-8, with or without a byte order mark, LF or CRLF; blank lines are skipped.
    sensors
        How many sensors the robot's ring has, where the log must fit one.

    Raises
    ------
    RingLogError
        Before the first firing where the file or its header is at fault, else at the row that is.
    """
    try:
        with path.open("rb") as file:
            yield from _firings(_rows(file, path), path, sensors)
    except OSError as error:
        raise RingLogError(f"{path}: cannot be read: {error.strerror or error}; check the path") from error


def write_ring_log(path: Path, firings: Iterable[Firing]) -> None:
    """Write firings as a ring log that `read_ring_log` gives back to the bit.

    Parameters
    ----------
    path
        Replaced if it exists.
    firings
        At least one, all of one ring, in order of time.

    Raises
    ------
    RingLogError
        Where a firing cannot stand in a ring log, or the file cannot be written. Rows before it are in the file.
    """
    try:
        with path.open("w", encoding="utf-8", newline="\n") as file:
            _write_rows(file, path, firings)
    except OSError as error:
        raise RingLogError(
            f"{path}: cannot be written: {error.strerror or error}; check the folder and the space left"
        ) from error


def _lines(file: BinaryIO, path: Path) -> Iterator[str]:
    """Yield the file's lines as text; decoded one by one, so that a complaint can name the row."""
    for row, raw in enumerate(iter(lambda: file.readline(LINE_MAX_BYTES), b""), start=1):
        if len(raw) == LINE_MAX_BYTES:
            raise _fault(path, row, f"is longer than {LINE_MAX_BYTES} bytes", "check that this is a ring log (CSV)")
        if b"\0" in raw:
            raise _fault(path, row, "holds NUL bytes, as binary files and UTF-16 do", "save it as CSV in UTF-8")
        try:
            yield raw.decode("utf-8-sig" if row == 1 else "utf-8")
        except UnicodeDecodeError as error:
            bad = f"0x{raw[error.start]:02x} at byte {error.start + 1}"
            raise _fault(path, row, f"is not UTF-8 ({bad})", "save it as CSV in UTF-8") from error


def _rows(file: BinaryIO, path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield the cells of each row that is not blank, with its number.

    Each line is read by itself. A quoted cell may span lines in CSV but not here: one quote too few would otherwise
    make a single row of the whole rest of the file, in memory.
    """
    for row, line in enumerate(_lines(file, path), start=1):
        try:
            cells = next(csv.reader((line,), strict=True))
        except csv.Error as error:
            hint = "save it with plain cells and LF or CRLF line ends"
            raise _fault(path, row, f"is not CSV ({error})", hint) from error
        if cells:
            yield row, cells


def _firings(rows: Iterator[tuple[int, list[str]]], path: Path, sensors: int | None) -> Iterator[Firing]:
    header_row, header = next(rows, (1, None))
    if header is None:
        raise RingLogError(f"{path}: is empty; {_FORM}")
    names = [name.strip() for name in header]
    first_range = _check_header(names, path, header_row)
    count = len(names) - first_range
    if sensors is not None and count != sensors:
        raise RingLogError(
            f"{path}: has {count} sensor columns (r00 to {names[-1]}), but the robot's ring has {sensors} sensors; "
            "name the robot file of the robot that recorded the log"
        )
    last_t, empty = -math.inf, True
    for row, cells in rows:
        if len(cells) != len(names):
            raise _fault(path, row, f"has {len(cells)} cells where the header has {len(names)}", _cells_hint(cells))
        try:
            stamp = [_finite(cell) for cell in cells[:first_range]]
            ranges = np.array([_range(cell) for cell in cells[first_range:]], dtype=np.float64)
        except ValueError as error:
            raise _cell_fault(path, row, names, cells, first_range) from error
        t, x, y, theta = stamp[:4]
        if t < last_t:
            hint = "t never decreases; sort the rows by t, or split the file where the clock began again"
            raise _fault(path, row, f"column 't' is {t!r}, earlier than {last_t!r} before it", hint)
        yield Firing(t, Pose(x, y, theta), stamp[-1], ranges)
        last_t, empty = t, False
    if empty:
        raise RingLogError(f"{path}: holds no firing, only a header; add a row for each firing")


def _check_header(names: Sequence[str], path: Path, row: int) -> int:
    """Return how many columns come before the ranges."""
    for name, times in Counter(names).items():
        if times > 1:
            raise _fault(path, row, f"names the column {_shown(name)} {times} times", f"each name once; {_FORM}")
    for name in REQUIRED:
        if name not in names:
            raise _fault(path, row, f"lacks the column {name!r}", _FORM)
    lead = [*REQUIRED, RING_YAW] if RING_YAW in names else [*REQUIRED]
    if len(names) == len(lead):
        raise _fault(path, row, "has no sensor column", _FORM)
    wanted = lead + [f"r{i:02d}" for i in range(len(names) - len(lead))]
    for i, (name, want) in enumerate(zip(names, wanted, strict=True)):
        if name != want:
            raise _fault(path, row, f"has {_shown(name)} as column {i + 1} where {want!r} belongs", _FORM)
    return len(lead)


def _plain(cell: str) -> float:
    """Return the number in a cell; `float` alone would also take 1_000 and digits of other scripts."""
    if "_" in cell or not cell.isascii():
        raise ValueError(cell)
    return float(cell)


def _finite(cell: str) -> float:
    value = _plain(cell)
    if not math.isfinite(value):
        raise ValueError(cell)
    return value


def _range(cell: str) -> float:
    if not cell:
        return math.nan
    value = _plain(cell)
    # 1e999 overflows to inf, yet nobody meant "heard nothing" by it. NaN compares false and is refused, too.
    if not value >= 0.0 or (value == math.inf and _SPELT_INF.fullmatch(cell) is None):
        raise ValueError(cell)
    return value


def _refuses(parse: Callable[[str], float], cell: str) -> bool:
    try:
        parse(cell)
    except ValueError:
        return True
    return False


def _cell_fault(path: Path, row: int, names: Sequence[str], cells: Sequence[str], first_range: int) -> RingLogError:
    """Return the complaint about the first bad cell of a row known to have one."""
    column = next(i for i, cell in enumerate(cells) if _refuses(_finite if i < first_range else _range, cell))
    allowed = _FINITE if column < first_range else _RANGE
    found = f"is {_shown(cells[column])}" if cells[column] else "is empty"
    return _fault(path, row, f"column {names[column]!r} {found}", f"allowed is {allowed}; correct or delete the row")


def _cells_hint(cells: Sequence[str]) -> str:
    if len(cells) == 1 and ";" in cells[0]:
        return "separate the cells by commas and write decimals with a point"
    return "a sensor that did not fire keeps its comma; complete the row, or delete it where the file was cut off"


def _shown(text: str) -> str:
    """Return a cell as one short printable piece of a complaint."""
    shown = ascii(text[:60])
    return shown if len(shown) <= 60 else f"{shown[:60]}…"


def _fault(path: Path, row: int, what: str, hint: str) -> RingLogError:
    return RingLogError(f"{path}: row {row} {what}; {hint}")


def _write_rows(file: TextIO, path: Path, firings: Iterable[Firing]) -> None:
    count, last_t = 0, -math.inf
    for row, firing in enumerate(firings, start=2):
        ranges = firing.ranges_m.tolist()
        if row == 2:
            count = len(ranges)
            file.write(",".join([*REQUIRED, RING_YAW, *(f"r{i:02d}" for i in range(count))]) + "\n")
        stamp = [firing.robot_s, firing.pose.x, firing.pose.y, firing.pose.theta, firing.ring_yaw]
        if len(ranges) != count or count == 0:
            raise _fault(path, row, f"would have {len(ranges)} sensors", f"the first firing has {count}, at least 1")
        if not all(map(math.isfinite, stamp)) or firing.robot_s < last_t:
            raise _fault(path, row, f"would have t, pose and ring yaw {stamp}", f"all are finite and t ≥ {last_t}")
        if any(r < 0.0 for r in ranges):
            raise _fault(path, row, f"would have the range {min(ranges)}", f"allowed is {_RANGE}")
        cells = [repr(float(value)) for value in stamp] + ["" if math.isnan(r) else repr(r) for r in ranges]
        file.write(",".join(cells) + "\n")
        last_t = firing.robot_s
    if count == 0:
        raise RingLogError(f"{path}: there is no firing to write; a ring log holds at least one")
