"""The one base class of every settings model: frozen, strict, and unknown keys are errors.

A misspelt key that is silently ignored is a robot that drives with settings nobody chose.
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
    """Let TOML's only sequence type fill an immutable field."""
    return tuple(value) if isinstance(value, list) else value


TomlList: TypeAlias = Annotated[tuple[T, ...], BeforeValidator(_list_as_tuple)]
"""An immutable sequence written as a TOML list."""

Coordinate: TypeAlias = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
"""A coordinate, metres; nobody drives ten kilometres by sonar, and the squares of a typo overflow."""

Point: TypeAlias = Annotated[tuple[Coordinate, Coordinate], BeforeValidator(_list_as_tuple)]
"""A pair of coordinates in metres written as a TOML list of two numbers."""
