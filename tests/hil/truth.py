"""The emulator's truth trace followed while it is written: each line is read once, however often one looks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from drivers.emulator.truth_trace import HEADER
from drivers.messages import Flags
from tests.hil.machine import LOOK_S, TIMEOUT_S

DRIVING_M_S = 0.2
_OF = [HEADER.split(",").index(name) for name in ("t_s", "host_s", "v_m_s", "w_rad_s", "flags")]


@dataclass(frozen=True)
class Row:
    """A row: the robot's own time, the host's at that moment, and how the wheels turn."""

    t_s: float
    """It does not go on where the emulator stands still."""
    host_s: float
    v: float
    w: float
    flags: Flags

    @property
    def still(self) -> bool:
        return self.v == 0.0 and self.w == 0.0

    @property
    def driving(self) -> bool:
        return self.v > DRIVING_M_S


@dataclass
class Truth:
    """What has been read of the trace so far."""

    path: Path
    rows: list[Row] = field(default_factory=list)
    _offset: int = 0

    def read(self) -> list[Row]:
        """Read on, and return all rows."""
        if self.path.exists():
            with self.path.open("rb") as file:
                file.seek(self._offset)
                data = file.read()
            whole = data[: data.rfind(b"\n") + 1]
            self._offset += len(whole)
            for line in whole.decode("ascii").splitlines():
                cells = line.split(",")
                if cells[0] != "t_s":
                    t_s, host_s, v, w, flags = (cells[i] for i in _OF)
                    self.rows.append(Row(float(t_s), float(host_s), float(v), float(w), Flags(int(flags))))
        return self.rows

    def at(self, host_s: float) -> Row:
        """Return the last row at or before a moment of the host's clock."""
        return next(row for row in reversed(self.read()) if row.host_s <= host_s)

    def at_robot(self, t_s: float) -> Row:
        """Return the last row at or before a moment of the robot's clock."""
        return next(row for row in reversed(self.read()) if row.t_s <= t_s)

    def since(self, t_s: float) -> list[Row]:
        """Return the rows after a moment of the robot's clock."""
        return [row for row in self.read() if row.t_s > t_s]

    def wait(self, done: Callable[[Row], bool], what: str, timeout_s: float = TIMEOUT_S) -> Row:
        """Wait until the newest row is as it should be, and return it."""
        end_s = time.monotonic() + timeout_s
        while not ((rows := self.read()) and done(rows[-1])):
            assert time.monotonic() < end_s, f"it never came: {what}"
            time.sleep(LOOK_S)
        return rows[-1]


def rows(trace: Path) -> list[Row]:
    """Return the complete rows so far, for those who look but now and then."""
    return Truth(trace).read()


def robot_time(trace: Path, host_s: float) -> float:
    """Return the robot's time at a moment of the host's clock that the trace has come to, s."""
    return max(row.t_s for row in rows(trace) if row.host_s <= host_s)


def is_driving(trace: Path) -> bool:
    """Say whether the wheels turn now."""
    now = rows(trace)
    return bool(now) and now[-1].driving


def reaches(trace: Path, host_s: float) -> bool:
    """Say whether the trace has come to a moment of the host's clock."""
    now = rows(trace)
    return bool(now) and now[-1].host_s >= host_s
