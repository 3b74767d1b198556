"""The rows of a ring log, from firings; `runtime.recording.ring_log` reads them again."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final, TextIO

from drivers.messages import CrossPaths, Firing
from runtime.recording.ring_log import (
    RANGE_ALLOWED,
    REQUIRED,
    RING_YAW,
    RingLogError,
    cross_column,
    row_error,
)
from runtime.recording.servo_columns import HINT, ServoColumns

_NAME_PAIRS: Final = "name the pairs of all its cross paths"


def write_ring_log(
    path: Path,
    firings: Iterable[Firing],
    pairs: Sequence[tuple[int, int]] = (),
    servos: ServoColumns | None = None,
) -> None:
    """Write firings as a ring log from which `read_ring_log` returns exactly the same values.

    Parameters
    ----------
    path : Path
        Replaced if it exists.
    firings : iterable of Firing
        At least one, all of one ring, in order of time.
    pairs : sequence of tuple
        The cross paths that occur in them, (transmitter, listener); see `drivers.firing_pattern.pattern_pairs`.
    servos : ServoColumns, optional
        The bearings of the ring, if sensors of it stand on servos.

    Raises
    ------
    RingLogError
        A firing cannot be represented, or the file cannot be written. The rows before it are in the file.
    """
    try:
        with path.open("w", encoding="utf-8", newline="\n") as file:
            rows = RingLogRows(file, path, pairs, servos)
            for firing in firings:
                rows.write(firing)
                if rows.dropped:
                    raise row_error(path, rows.count + 1, "would have a cross path without a column", _NAME_PAIRS)
            rows.check_not_empty()
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path: Path, error: OSError) -> RingLogError:
    """Return the message for a ring log that the disk refuses."""
    return RingLogError(f"{path}: cannot be written: {error.strerror or error}; check the folder and the space left")


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
    servos : ServoColumns, optional
        The bearings that get a column.
    """

    def __init__(
        self, file: TextIO, path: Path, pairs: Sequence[tuple[int, int]] = (), servos: ServoColumns | None = None
    ) -> None:
        self._servos = servos if servos is not None and servos.sensors else None
        self._file = file
        self._path = path
        self._pairs = tuple(pairs)
        self.count = 0
        """Firings written so far."""
        self.dropped = 0
        """Cross paths left out because they have no column."""
        self._sensors = 0
        """Number of range columns; 0 before the header."""
        self._last_t = -math.inf
        """Time of the last row, s."""

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
        ranges: list[float] = firing.ranges_m.tolist()
        bearings: list[float] = []
        if self._servos is not None:
            try:
                ranges, bearings = self._servos.row(firing.ranges_m)
            except ValueError as error:
                raise row_error(path, row, f"would have {error}", HINT) from error
        if self.count == 0:
            self._sensors, angles = len(ranges), [] if self._servos is None else self._servos.names
            columns = [
                *(f"r{i:02d}" for i in range(self._sensors)),
                *angles,
                *(cross_column(*pair) for pair in self._pairs),
            ]
            self._file.write(",".join([*REQUIRED, RING_YAW, *columns]) + "\n")
        stamp = [firing.robot_s, firing.pose.x, firing.pose.y, firing.pose.theta, firing.ring_yaw]
        if len(ranges) != self._sensors or not ranges:
            expected = f"the first firing has {self._sensors}, at least 1"
            raise row_error(path, row, f"would have {len(ranges)} sensors", expected)
        if not all(map(math.isfinite, stamp)) or firing.robot_s < self._last_t:
            expected = f"all are finite and t ≥ {self._last_t}"
            raise row_error(path, row, f"would have t, pose and ring yaw {stamp}", expected)
        if any(r < 0.0 for r in ranges):
            raise row_error(path, row, f"would have the range {min(ranges)}", f"allowed is {RANGE_ALLOWED}")
        ranges += [*bearings, *self._half_paths(firing.cross_paths)]
        cells = [repr(float(value)) for value in stamp] + ["" if math.isnan(r) else repr(r) for r in ranges]
        self._file.write(",".join(cells) + "\n")
        self._last_t = firing.robot_s
        self.count += 1

    def _half_paths(self, heard: CrossPaths | None) -> list[float]:
        """Return a number for each column of half paths, NaN where none listened; count those without a column."""
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
