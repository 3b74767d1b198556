"""Base class of every settings model: frozen, strict, and unknown keys are errors.

A misspelt key must not be ignored: the robot would drive with settings that were not intended.
"""

from __future__ import annotations

import functools
import sys
import types
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any, TypeAlias, TypeVar, Union, get_args, get_origin

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
    )


def description(model: type[BaseModel], name: str) -> str | None:
    """Return what a setting is for: the text below its line in the source.

    Pydantic can read these texts as well, but does so whenever a model is imported, which takes a third of that time.
    """
    own = model.model_fields[name].description
    if own is not None:
        return own
    texts = (_texts(base.__module__).get((base.__qualname__, name)) for base in model.__mro__ if base is not object)
    return next((text for text in texts if text is not None), None)


def without_none(annotation: Any) -> tuple[Any, ...]:  # noqa: ANN401 - an annotation can be anything
    """Return the members of a union but None, or the annotation alone."""
    options = get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)
    return tuple(option for option in options if option is not type(None))


@functools.cache
def _texts(module: str) -> Mapping[tuple[str, str], str]:
    """Return the texts below the lines of a module's classes, by class and name."""
    import ast
    import inspect

    return {
        (found.name, line.target.id): inspect.cleandoc(text.value.value)
        for found in ast.parse(inspect.getsource(sys.modules[module])).body
        if isinstance(found, ast.ClassDef)
        for line, text in pairwise(found.body)
        if isinstance(line, ast.AnnAssign) and isinstance(line.target, ast.Name)
        if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
    }


def _list_as_tuple(value: object) -> object:
    """Return a list as a tuple, and other values unchanged: TOML has no immutable sequence."""
    return tuple(value) if isinstance(value, list) else value


TomlList: TypeAlias = Annotated[tuple[T, ...], BeforeValidator(_list_as_tuple)]
"""An immutable sequence written as a TOML list."""

Coordinate: TypeAlias = Annotated[float, Field(ge=-10_000.0, le=10_000.0)]
"""A coordinate, m; the limit refuses typing errors whose squares would overflow."""

Point: TypeAlias = Annotated[tuple[Coordinate, Coordinate], BeforeValidator(_list_as_tuple)]
"""A pair of coordinates in metres written as a TOML list of two numbers."""
