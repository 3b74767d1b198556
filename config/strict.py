"""Base class of every settings model: frozen, strict, and unknown keys are errors.

A misspelt key must not be ignored: the robot would drive with settings that were not intended.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

T = TypeVar("T")


class Strict(BaseModel):
    """A settings model: immutable, no coercion, no unknown keys, no NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        strict=True,
        extra="forbid",
        allow_inf_nan=False,
        validate_default=True,
        use_attribute_docstrings=True,
    )


def _list_as_tuple(value: object) -> object:
    """Return a list as a tuple, and other values unchanged: TOML has no immutable sequence."""
    return tuple(value) if isinstance(value, list) else value


TomlList: TypeAlias = Annotated[tuple[T, ...], BeforeValidator(_list_as_tuple)]
"""An immutable sequence written as a TOML list."""

Coordinate: TypeAlias = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
"""A coordinate, m; the limit refuses typing errors whose squares would overflow."""

Point: TypeAlias = Annotated[tuple[Coordinate, Coordinate], BeforeValidator(_list_as_tuple)]
"""A pair of coordinates in metres written as a TOML list of two numbers."""
