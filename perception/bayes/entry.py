"""What Python calls: kernels that take one handle instead of the two named tuples.

A named tuple is handed to compiled code member by member: eighty of them cost 7 µs a call, as much as the work. A
handle is a reference to a struct that holds both tuples and goes over as one pointer. Its arrays are the tuples' own:
what a kernel writes through it is seen in them.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numba
from numba.core import types
from numba.experimental import structref

from perception.bayes import object_report as report
from perception.bayes import observe as observing
from perception.bayes import polygon_tracks, refine
from perception.bayes.state import Settings, State
from perception.kernel import Floats, Ints, owning_kernel


class Handle(NamedTuple):
    """Memory and settings; compiled code gets a `Reference` instead, of the same attributes."""

    s: State
    p: Settings


@structref.register
class ReferenceType(types.StructRef):
    """Numba's type of a reference."""


class Reference(structref.StructRefProxy):
    """What Python holds of it: a pointer."""


_untyped: Final[Any] = numba
_untyped.experimental.structref.define_proxy(Reference, ReferenceType, Handle._fields)
HANDLE: Final[Any] = Handle if _untyped.config.DISABLE_JIT else Reference


@owning_kernel
def hold(s: State, p: Settings) -> Handle:
    """Return a handle on memory and settings."""
    handle: Handle = HANDLE(s, p)
    return handle


@owning_kernel
def observe(
    h: Handle, mounts: Floats, px: float, py: float, yaw: float, now: float, ranges: Floats, threshold: float
) -> tuple[int, bool]:
    """Take in one firing; see `perception.bayes.observe.observe`."""
    return observing.observe(h.s, h.p, mounts, px, py, yaw, now, ranges, threshold)


@owning_kernel
def quantum(h: Handle, threshold: float) -> bool:
    """Refine one circle; see `perception.bayes.refine.quantum`."""
    return refine.quantum(h.s, h.p, threshold)


@owning_kernel
def pquantum(h: Handle, threshold: float) -> bool:
    """Refine one polygon; see `perception.bayes.polygon_tracks.pquantum`."""
    return polygon_tracks.pquantum(h.s, h.p, threshold)


@owning_kernel
def sure_circles(h: Handle, told: Floats, sure: Ints) -> int:
    """Write the circles that have a name to `sure`, those that changed as ~t, and return how many; see `report`."""
    s = h.s
    n = report.sure_circles(s.ti, s.names, sure)
    report.mark_changed(s.ti, s.tf, s.names, told, n, sure)
    return n
