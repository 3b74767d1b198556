"""Numbers that a recording holds, with the bounds within which arithmetic can bear them, as annotations.

A recording is written by this program and read by anyone. A field of a dataclass that is recorded declares its bound
in its annotation, and pydantic refuses a value beyond it before anything computes with it. What fields must have in
common is said by a method `contradiction` of their class, which `CONSISTENT` calls.
"""

from __future__ import annotations

from typing import Annotated, Final, Protocol, TypeAlias, TypeVar

from pydantic import AfterValidator, Field

TIME_MAX_S: Final = 1e9
"""Greatest time, s: thirty years."""
COORDINATE_MAX: Final = 1e6
"""Greatest coordinate, m; also the greatest unwrapped angle, rad."""
SPEED_MAX: Final = 1e6
"""Greatest velocity, m/s and rad/s."""
VECTOR_MAX: Final = 1e12
"""Greatest part of a schema's vector: what pushes without bound has 1e6, by a gain of at most 100, for each echo."""
RANGE_MAX_M: Final = 1e3
"""Greatest range, m; a sensor listens up to 100 m at most."""
COUNT_MAX: Final = 2**53
"""Greatest count or number; a float still holds it exactly."""

Seconds: TypeAlias = Annotated[float, Field(ge=-TIME_MAX_S, le=TIME_MAX_S, allow_inf_nan=False)]
Coordinate: TypeAlias = Annotated[float, Field(ge=-COORDINATE_MAX, le=COORDINATE_MAX, allow_inf_nan=False)]
"""A place or a way, m, or an angle, rad."""
Speed: TypeAlias = Annotated[float, Field(ge=-SPEED_MAX, le=SPEED_MAX, allow_inf_nan=False)]
VectorPart: TypeAlias = Annotated[float, Field(ge=-VECTOR_MAX, le=VECTOR_MAX, allow_inf_nan=False)]
Count: TypeAlias = Annotated[int, Field(ge=0, le=COUNT_MAX)]
Number: TypeAlias = Annotated[int, Field(ge=-COUNT_MAX, le=COUNT_MAX)]
Sign: TypeAlias = Annotated[int, Field(ge=-1, le=1)]


class Contradictory(Protocol):
    """A record whose fields must agree with each other."""

    def contradiction(self) -> str | None:
        """Return in what they do not agree; None if they do."""
        ...


Checked = TypeVar("Checked", bound=Contradictory)


def _consistent(record: Checked) -> Checked:
    if (found := record.contradiction()) is not None:
        raise ValueError(found)
    return record


CONSISTENT: Final = AfterValidator(_consistent)
"""Of an annotation: a record that contradicts itself is refused as it is read."""
