"""The schedule of a fault script: the faults that are active at a time, and the next change."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from typing import TypeVar

import numpy as np

from drivers.emulator.faults import ClockError, Fault

F = TypeVar("F", bound=Fault)


class FaultSchedule:
    """Starts and ends faults in the order of their times; a fault without duration ends right after it starts."""

    def __init__(self, faults: Sequence[Fault]) -> None:
        self._planned = tuple(faults)
        self._clock_errors = self.planned(ClockError)
        edges = []
        for fault in faults:
            begin = round(fault.at_s * 1e6)
            edges += [(begin, True, fault), (begin + round(fault.duration_s * 1e6), False, fault)]
        self._edges = deque(sorted(edges, key=lambda edge: edge[0]))
        """What is still to come: time, µs, whether it begins, fault."""
        self._active: list[Fault] = []
        """The faults that `set_active` switched on."""

    @property
    def next_us(self) -> int | None:
        """Time at which the next fault starts or ends, µs; None if there are no more changes."""
        return self._edges[0][0] if self._edges else None

    def due(self, now_us: int) -> Iterator[tuple[bool, Fault]]:
        """Yield each fault that starts (True) or ends (False) by now; the caller calls `set_active`."""
        while self._edges and self._edges[0][0] <= now_us:
            _, begins, fault = self._edges.popleft()
            yield begins, fault

    def set_active(self, fault: Fault, *, on: bool) -> None:
        """Mark a fault as active or not."""
        if on:
            self._active.append(fault)
        else:
            self._active.remove(fault)

    def has(self, kind: type[Fault]) -> bool:
        """Return whether a fault of this kind is active."""
        # Called at every event; in most calls no fault is active.
        return bool(self._active) and any(isinstance(fault, kind) for fault in self._active)

    def planned(self, kind: type[F]) -> list[F]:
        """Return all faults of this kind in the script."""
        return [fault for fault in self._planned if isinstance(fault, kind)]

    def clock_us(self, at_us: int) -> int:
        """Return what a clock with the script's errors of the robot's clock shows at a time, µs."""
        shown_us = at_us
        for error in self._clock_errors:
            begin_us = round(error.at_s * 1e6)
            if at_us >= begin_us:
                lasted_us = min(at_us - begin_us, round(error.duration_s * 1e6))
                shown_us += round(error.leap_s * 1e6 + (error.rate - 1.0) * lasted_us)
                if error.step_s > 0.0 and lasted_us == at_us - begin_us:
                    shown_us -= shown_us % round(error.step_s * 1e6)
        return shown_us

    def all(self, kind: type[F]) -> list[F]:
        """Return the active faults of this kind."""
        return [fault for fault in self._active if isinstance(fault, kind)] if self._active else []


def flip_bits(data: bytes, rate: float, rng: np.random.Generator) -> bytes:
    """Return `data` with each bit flipped with probability `rate`.

    Parameters
    ----------
    data : bytes
        Bytes on the line; not changed.
    rate : float
        Probability that a bit flips, 0 to 1.
    rng : numpy.random.Generator
        Source of the random numbers; eight are drawn for each byte, whatever the rate.
    """
    flips = rng.random(8 * len(data)) < rate
    return (np.frombuffer(data, dtype=np.uint8) ^ np.packbits(flips)).tobytes()
