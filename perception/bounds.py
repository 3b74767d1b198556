"""Bounds of the numbers that perception remembers, declared beside them and checked before a state is restored.

A keyframe comes from a file, and a file may come from anyone. Its state is handed to compiled kernels, which check no
index: one out of range reads or writes the memory of the process. So every remembered number has a bound: a record's
field in its annotation (`count: Count`, `kind: Annotated[int, index_of(CIRCLES_MAX)]`), an attribute of an object in
the mapping `BOUNDS` of its class. `perception.snapshot.bounds_of` collects them.

A bound follows from the dtype and the meaning of a number, never from what runs have shown: an index has the size of
its array, a flag is 0 or 1, and a count or a sum may grow for as long as a robot can run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from config.bounded import COUNT_MAX


class Bound(NamedTuple):
    """The values that a number may have."""

    low: float
    """Both ends are included."""
    high: float
    infinite: bool = False
    """Whether it may be infinite besides: no echo, no evidence, no place or no time yet."""
    nan: bool = False
    """Whether it may be NaN besides: not measured yet."""
    constant: bool = False
    """Whether only the value is right that the settings give, which no cycle changes."""


FLAG: Final = Bound(0, 1)
COUNT: Final = Bound(0, COUNT_MAX)
"""Of a count, which becomes an index only after it was reduced to one; it does not overflow in a robot's lifetime."""
SIGNED: Final = Bound(-COUNT_MAX, COUNT_MAX)
SHARE: Final = Bound(0.0, 1.0 + 1e-9)
"""Of a share or a probability; parts may exceed the whole by rounding."""
RANGE: Final = Bound(0.0, 1e7)
"""Of a range, m; silence is a range beyond all others. Cells and bins of a range are counted."""
PLACE: Final = Bound(-1e12, 1e12)
"""Of a place (m), a direction (rad) or a time (s), from which indices are computed: their conversion to a whole
number is exact. A robot at 3 m/s is 3e5 m away after a day; the time since 1970 is 2e9 s."""
FINITE: Final = Bound(-1e100, 1e100)
"""Of evidence, information, variances and their sums, from which no index is computed. A sum grows by less than 1e30
for each reading, and stays below 1e46 for as long as adding to it changes it; products of three are finite."""
POSITIVE: Final = Bound(0.0, FINITE.high)
CONSTANT: Final = Bound(FINITE.low, FINITE.high, constant=True)
UNHEARD: Final = Bound(0.0, 0.0, nan=True)
"""Of a record within a record: its floats have the bounds of their own and may be NaN besides."""

Count: TypeAlias = Annotated[int, COUNT]
Flag: TypeAlias = Annotated[int, FLAG]
Share: TypeAlias = Annotated[float, SHARE]
Place: TypeAlias = Annotated[float, PLACE]
Finite: TypeAlias = Annotated[float, FINITE]

Fields: TypeAlias = Mapping[str, "Bound | Fields"]
"""Bounds of the fields of records, by name."""
Declared: TypeAlias = "Bound | Fields | Callable[[Any], Bound | Fields]"
"""What a class declares of an attribute: its bound, those of a record's fields (`Record.BOUNDS`), or a function of
the object that returns one of these where it depends on the settings."""


def index_of(size: int) -> Bound:
    """Return the bound of an index of an array of `size` items; 0 where there are none."""
    return Bound(0, max(0, size - 1))


def up_to(most: int) -> Bound:
    """Return the bound of a number of items of which there is room for `most`."""
    return Bound(0, most)


def bounds(inner: Mapping[str, Declared] | None = None, /, **attributes: Declared) -> Mapping[str, Declared]:
    """Return what a class declares in `BOUNDS`.

    Parameters
    ----------
    inner : mapping
        By dotted name: fields of the object's parts whose bounds only this object knows, as the models are its own.
    **attributes
        By the name of the object's own attribute. Flags of dtype bool need no declaration.
    """
    return MappingProxyType({**attributes, **(inner or {})})


def relaxed(bound: Bound | Fields) -> Bound | Fields:
    """Return bounds that allow NaN besides."""
    if isinstance(bound, Bound):
        return bound._replace(nan=True)
    return {name: relaxed(inner) for name, inner in bound.items()}


def check_values(name: str, values: NDArray[Any], bound: Bound) -> None:
    """Check all values of one number.

    Raises
    ------
    ValueError
        A value is out of its bound.
    """
    if values.dtype.kind == "b":
        values = values.view(np.uint8)  # any other byte than 0 and 1 misleads numpy
    if bound.nan:
        values = values[~np.isnan(values)]
    if bound.infinite:
        values = values[~np.isinf(values)]
    if values.size and not (values.min() >= bound.low and values.max() <= bound.high):  # also refuses NaN
        wrong = values.max() if values.min() >= bound.low else values.min()
        raise ValueError(f"{name} is {wrong}, expected {bound.low:g} to {bound.high:g}")
