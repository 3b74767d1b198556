"""The parameters that may be changed while the robot runs, as read off the schema: no list of them is kept by hand.

Whatever `config.reload` lets a running process follow and one value can say is in it, with the bounds, the choices
and the words of the schema itself.
"""

from __future__ import annotations

import types
from collections.abc import Iterator
from types import MappingProxyType
from typing import Any, Final, Literal, TypedDict, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from config.layers import Location
from config.reload import Difference
from config.settings import Settings

KINDS: Final = ((bool, "bool"), (int, "int"), (float, "float"), (str, "text"))
"""Plain types, bool before the int that it is."""
UNITS: Final = MappingProxyType({
    "_m_s": "m/s", "_rad_s": "rad/s", "_per_s": "1/s", "_deg": "°", "_rad": "rad", "_hz": "Hz", "_m": "m", "_s": "s"
})  # fmt: skip
"""Endings of names, the longer before those that they end in."""


class Parameter(TypedDict):
    """A parameter, as the page is told of it."""

    path: str
    label: str
    value: bool | int | float | str | None
    low: float | None
    high: float | None
    kind: str
    choices: list[str] | None
    optional: bool
    """Whether null is a value."""
    help: str


def parameters(settings: Settings) -> list[Parameter]:
    """Return every live parameter with its present value, in the order of the schema."""
    return list(_within(settings, ()))


def _within(model: BaseModel, at: Location) -> Iterator[Parameter]:
    for name, field in type(model).model_fields.items():
        location, value = (*at, name), getattr(model, name)
        if isinstance(value, BaseModel):
            yield from _within(value, location)
        elif Difference(location, None, None).live and (told := _parameter(location, field, value)) is not None:
            told["help"] = " ".join((field.description or type(model).__doc__ or "").split())
            yield told


def _parameter(location: Location, field: FieldInfo, value: Any) -> Parameter | None:  # noqa: ANN401
    """Return a field as a parameter, None where it takes more than one plain value."""
    kinds = [kind for kind in _options(field.annotation) if kind is not type(None)]
    if len(kinds) != 1:
        return None
    kind, choices = kinds[0], None
    if get_origin(kind) is Literal:
        name, choices = "choice", [str(choice) for choice in get_args(kind)]
    else:
        known = next((name for plain, name in KINDS if kind is plain), None)
        if known is None:
            return None
        name = known
    low, high = _bounds(field)
    return {
        "path": ".".join(map(str, location)),
        "label": _label(str(location[-1])),
        "value": value,
        "low": low,
        "high": high,
        "kind": name,
        "choices": choices,
        "optional": type(None) in _options(field.annotation),
        "help": "",
    }


def _label(name: str) -> str:
    """Return a name in words, its unit apart."""
    ending = next((ending for ending in UNITS if name.endswith(ending)), "")
    unit = f" ({UNITS[ending]})" if ending else ""
    return name.removesuffix(ending).replace("_", " ") + unit


def _options(annotation: Any) -> tuple[Any, ...]:  # noqa: ANN401 - an annotation can be anything
    return get_args(annotation) if get_origin(annotation) in (Union, types.UnionType) else (annotation,)


def _bounds(field: FieldInfo) -> tuple[float | None, float | None]:
    low: float | None = None
    high: float | None = None
    for bound in field.metadata:
        match bound:
            case annotated_types.Ge(ge=value) | annotated_types.Gt(gt=value):
                low = float(value)  # type: ignore[arg-type]
            case annotated_types.Le(le=value) | annotated_types.Lt(lt=value):
                high = float(value)  # type: ignore[arg-type]
    return low, high
