"""The settings that the page can change, derived from the configuration schema.

They are the settings that a running process can follow (`config.reload`) and that have a single plain value, with the
bounds, choices and descriptions of the schema.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, TypedDict, get_args, get_origin

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from config.layers import Location
from config.reload import Difference
from config.settings import Settings
from config.strict import description, without_none
from config.toml_edit import inline

KINDS: Final = ((bool, "bool"), (int, "int"), (float, "float"), (str, "text"))
"""Plain types and their names on the wire; bool precedes int, of which it is a subclass."""
TOML: Final = "toml"
"""The name of all others, whose value is a text in TOML."""
UNITS: Final = MappingProxyType(
    {"_m_s": "m/s", "_rad_s": "rad/s", "_per_s": "1/s", "_deg": "°", "_rad": "rad", "_hz": "Hz", "_m": "m", "_s": "s"}
)
"""Units by the ending of a name; a longer ending precedes its own endings."""


class Parameter(TypedDict):
    """A setting as the page gets it."""

    path: str
    label: str
    value: bool | int | float | str | None
    low: float | None
    high: float | None
    kind: str
    choices: list[str] | None
    optional: bool
    """Whether null is a valid value."""
    help: str


def parameters(settings: Settings) -> list[Parameter]:
    """Return every setting that the page can change, with its current value, in the order of the schema."""
    return list(_within(settings, ()))


def _within(model: BaseModel, at: Location) -> Iterator[Parameter]:
    """Yield the parameters of a model at a place in the settings, those within it, too."""
    for name, field in type(model).model_fields.items():
        location, value = (*at, name), getattr(model, name)
        if isinstance(value, BaseModel):
            yield from _within(value, location)
        elif Difference(location, None, None).live and (found := _parameter(location, field, value)) is not None:
            found["help"] = " ".join((description(type(model), name) or type(model).__doc__ or "").split())
            yield found


def fields_of(model: type[BaseModel], values: Mapping[str, Any], at: Location) -> Iterator[Parameter]:
    """Yield every key of a table in a file, whether the file gives it or not; lists and the like as text in TOML.

    `values` is the table as the file has it, which need not be valid; `at` is where.
    """
    for name, field in model.model_fields.items():
        location, inner = (*at, name), field.annotation
        value = values.get(name, None if field.is_required() else field.get_default(call_default_factory=True))
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from fields_of(inner, value if isinstance(value, Mapping) else {}, location)
            continue
        found = _parameter(location, field, value)
        if found is not None and found["choices"] == [value]:
            continue
        text = " ".join((description(model, name) or model.__doc__ or "").split())
        if found is None:
            yield _in_toml(location, field, value, text)
            continue
        found["value"] = value if isinstance(value, bool | int | float | str | None) else str(value)
        found["help"] = text
        yield found


def _in_toml(location: Location, field: FieldInfo, value: Any, text: str) -> Parameter:  # noqa: ANN401 - any setting
    """Return a field that has no single plain value as a text in TOML."""
    from config.reference import bounds_of, type_of  # here, as a start should not wait for it

    kind = ", ".join(part for part in (type_of(field.annotation), bounds_of(field)) if part)
    return {
        "path": ".".join(map(str, location)),
        "label": _label(str(location[-1])),
        "value": None if value is None else inline(value),
        "low": None,
        "high": None,
        "kind": TOML,
        "choices": None,
        "optional": False,
        "help": f"{text} As in TOML, {kind}; empty: the default.".strip(),
    }


def _parameter(location: Location, field: FieldInfo, value: Any) -> Parameter | None:  # noqa: ANN401 - any setting
    """Return a field as a parameter, None if its value is not a single plain one: a choice of numbers is none."""
    kinds = without_none(field.annotation)
    if len(kinds) != 1:
        return None
    kind, choices = kinds[0], None
    if get_origin(kind) is Literal and all(isinstance(choice, str) for choice in get_args(kind)):
        name, choices = "choice", list(get_args(kind))
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
        "optional": type(None) in get_args(field.annotation),
        "help": "",
    }


def _label(name: str) -> str:
    """Return a name in words, with its unit in parentheses."""
    ending = next((ending for ending in UNITS if name.endswith(ending)), "")
    unit = f" ({UNITS[ending]})" if ending else ""
    return name.removesuffix(ending).replace("_", " ") + unit


def _bounds(field: FieldInfo) -> tuple[float | None, float | None]:
    """Return a field's lower and upper bound, None where it is unbounded."""
    low: float | None = None
    high: float | None = None
    for bound in field.metadata:
        match bound:
            case annotated_types.Ge(ge=value) | annotated_types.Gt(gt=value):
                low = float(value)  # type: ignore[arg-type]  # the library promises a comparison only
            case annotated_types.Le(le=value) | annotated_types.Lt(lt=value):
                high = float(value)  # type: ignore[arg-type]  # the library promises a comparison only
    return low, high
