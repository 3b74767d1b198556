"""Error messages for pydantic's validation errors: file, dotted path, value, allowed values, nearest known name."""

from __future__ import annotations

import datetime
import json
import re
import types
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from config.files import did_you_mean, dotted
from config.layers import Layers, Location
from config.plugins import SCHEMAS, plugged, plugged_table, plugged_use

EXPECTED = MappingProxyType(
    {
        "float_type": "a number",
        "int_type": "an integer",
        "bool_type": "true or false",
        "string_type": "a string",
        "tuple_type": "a list",
        "model_type": "a table",
        "model_attributes_type": "a table",
        "dict_type": "a table",
    }
)
"""Expected type, by the type of pydantic's error."""

GIVEN: tuple[tuple[type | tuple[type, ...], str], ...] = (
    (bool, "true or false"),
    (int, "an integer"),
    (float, "a number with a fraction"),
    (str, "a string"),
    ((list, tuple), "a list"),
    (dict, "a table"),
    ((datetime.date, datetime.time), "a date or time"),
)
"""Names of the types of TOML values; bool comes before int because Python's bool is an int."""

BOUNDS = MappingProxyType(
    {
        "greater_than": "above",
        "greater_than_equal": "at least",
        "less_than": "below",
        "less_than_equal": "at most",
    }
)

RENAMED_KEYS: Mapping[Location, str] = MappingProxyType({("perception", "full"): "perception.bayes"})
"""Former names of settings and sections, each with the present name."""
RENAMED_VALUES: Mapping[tuple[Location, object], str] = MappingProxyType(
    {(("perception", "method"), "full"): "bayes"}
)
"""Former values of settings, each with the present value."""

PROBLEMS_MAX = 100
"""Largest number of problems reported; a file with more is probably of another kind."""


def describe_errors(error: ValidationError, layers: Layers, model: type[BaseModel]) -> list[str]:
    """Return one line for each problem in `error`, in the order of the schema.

    The error is that of the layers' tree; `model` is the schema of the whole.
    """
    found = error.errors(include_url=False)
    at_fault = {details["loc"] for details in found}
    above_faults = {where[:n] for where in at_fault for n in range(len(where))}
    # pydantic also reports a list with invalid entries as too short; that is not a second problem.
    reported = [d for d in found if d["type"] != "too_short" or d["loc"] not in above_faults]
    lines = [_describe(details, layers, model) for details in reported[:PROBLEMS_MAX]]
    return lines if len(reported) <= PROBLEMS_MAX else [*lines, f"… and {len(reported) - PROBLEMS_MAX} problems more"]


def shown(value: object) -> str:
    """Return a value as TOML writes it, shortened to 60 characters."""
    if isinstance(value, str):
        text = json.dumps(value, ensure_ascii=not value.isprintable())
    elif isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, list | tuple):
        text = f"[{', '.join(shown(v) for v in value[:20])}]"
    elif isinstance(value, dict):
        text = "{…}"
    else:
        text = str(value)
    return text if len(text) <= 60 else text[:59] + "…"


def given_type(value: object) -> str:
    """Return the type of a value in TOML's terms."""
    return next((name for kinds, name in GIVEN if isinstance(value, kinds)), type(value).__name__)


def unknown_key(location: Location, model: type[BaseModel], also: tuple[str, ...] = ()) -> str:
    """Return the message for an unknown key: the nearest name here, the same name elsewhere, or all names.

    `model` is the schema of the whole tree; `also` are further names that are known here.
    """
    key = str(location[-1])
    parent = _unwrapped(_annotation_at(model, location[:-1]))
    known = tuple(dict.fromkeys((*_fields(parent), *also)))
    near = did_you_mean(key, known)
    elsewhere = [] if near else [dotted(p) for p in _every_location(model) if p[-1] == key][:2]
    if elsewhere:
        near = f"; did you mean {' or '.join(elsewhere)}?"
    return f"unknown key{near or '; known here: ' + ', '.join(known)}"


def _describe(details: ErrorDetails, layers: Layers, model: type[BaseModel]) -> str:
    """Return an error of pydantic as a line: file, key as the file has it, value, and what is wrong."""
    location, kind, value = details["loc"], details["type"], details["input"]
    context = details.get("ctx", {})
    if kind == "value_error":
        return _describe_whole(location, str(context.get("error", details["msg"])), value, layers, model)
    source = layers.source_of(location)
    path = dotted(source.local(_written(location, model)))
    tags = [tag for member in _members(_unwrapped(_annotation_at(model, location))) for tag in _tags(member)]
    tags += plugged(SCHEMAS) if "move_ahead" in tags else ()
    if kind == "union_tag_not_found":
        return f"{source.name}: {path}.{_tag_key(context)}: missing; must be one of {', '.join(tags)}"
    if kind == "union_tag_invalid":
        tag = shown(value[_tag_key(context)])
        near = did_you_mean(str(context["tag"]), tags)
        return f"{source.name}: {path}.{_tag_key(context)} = {tag}: must be one of {', '.join(tags)}{near}"
    if kind == "missing":
        return f"{source.name}: {path}: missing"
    if kind == "extra_forbidden" and location in RENAMED_KEYS:
        return f"{source.name}: {path}: was renamed: call it {RENAMED_KEYS[location]}"
    if kind == "extra_forbidden":
        also = ("robot",) if len(location) == 1 and "models" in model.model_fields else ()
        return f"{source.name}: {path}: {unknown_key(location, model, also)}"
    return f"{source.name}: {path} = {shown(value)}: {_message(details, model)}"


def _message(details: ErrorDetails, model: type[BaseModel]) -> str:
    """Return what is wrong with a value, as "must be …" or "needs …", in the words of the files."""
    location, kind, value = details["loc"], details["type"], details["input"]
    context = details.get("ctx", {})
    if kind in EXPECTED:
        return f"must be {EXPECTED[kind]}, not {given_type(value)}"
    if kind in BOUNDS:
        bound = next(v for k, v in context.items() if k in ("gt", "ge", "lt", "le"))
        return f"must be {BOUNDS[kind]} {_number(bound)}{_other_bounds(model, location, kind)}"
    if kind == "finite_number":
        return "must be a finite number"
    if kind == "literal_error" and (renamed := RENAMED_VALUES.get((location, str(value)))) is not None:
        return f'was renamed: write "{renamed}"'
    if kind == "literal_error":
        names = [str(a) for a in get_args(_unwrapped(_annotation_at(model, location)))]
        return f"must be one of {', '.join(names)}{did_you_mean(value, names) if isinstance(value, str) else ''}"
    if kind == "too_short":
        return f"needs at least {_entries(context['min_length'])}, has {len(value)}"
    if kind == "too_long":
        return f"may have at most {_entries(context['max_length'])}, has {len(value)}"
    if kind == "string_too_short":
        return "must not be empty"
    if kind == "string_pattern_mismatch":
        return f"must match {context['pattern']}"
    return details["msg"][:1].lower() + details["msg"][1:]


def _describe_whole(location: Location, text: str, table: object, layers: Layers, model: type[BaseModel]) -> str:
    """Return the line for a conflict among the values of one table, with the sources of the values that it names."""
    keys = table.keys() if isinstance(table, dict) else ()
    named = [(*location, k) for k in keys if re.search(rf"\b{re.escape(k)}\b", text)]
    sources = [s for where in named for s in [layers.source_of(where)]] or layers.sources_within(location)
    names = layers.newest_first(sources)
    written = _written(location, model)
    path = dotted(sources[0].local(written) if len(names) == 1 else written)
    return f"{' over '.join(names)}: {path + ': ' if path else ''}{text}"


def _entries(count: int) -> str:
    return "one entry" if count == 1 else f"{count} entries"


def _number(bound: object) -> str:
    return f"{bound:g}" if isinstance(bound, float) else str(bound)


def _other_bounds(model: type[BaseModel], location: Location, kind: str) -> str:
    """Return the bounds of a field beside the one that was broken, as " (and …)"; empty if there are none."""
    field = _field_at(model, location)
    words: list[str] = []
    for bound in field.metadata if field is not None else ():
        for constraint, attribute, word in (
            (annotated_types.Gt, "gt", "greater_than"),
            (annotated_types.Ge, "ge", "greater_than_equal"),
            (annotated_types.Lt, "lt", "less_than"),
            (annotated_types.Le, "le", "less_than_equal"),
        ):
            if isinstance(bound, constraint) and word != kind:
                words.append(f"{BOUNDS[word]} {_number(getattr(bound, attribute))}")
    return f" (and {' and '.join(words)})" if words else ""


def _unwrapped(annotation: object) -> object:
    """Return an annotation without Annotated and without the None of an optional field."""
    while True:
        origin, arguments = get_origin(annotation), get_args(annotation)
        if origin is Annotated:
            annotation = arguments[0]
        elif origin in (Union, types.UnionType) and len(_members(annotation)) < 2:
            annotation = next(a for a in arguments if a is not type(None))
        else:
            return annotation


def _members(annotation: object) -> list[type[BaseModel]]:
    """Return the tables of which a value may be any, if its first key says which one."""
    return [a for a in get_args(annotation) if isinstance(a, type) and issubclass(a, BaseModel)]


def _tagged(annotation: object, tag: str | int) -> object:
    """Return the table of a union that has this value of its first key."""
    found = next((member for member in _members(annotation) if tag in _tags(member)), None)
    return plugged_use(str(tag)) if found is None else found


def _tag_key(context: Mapping[str, object]) -> str:
    """Return the key whose value says which table it is."""
    return str(context["discriminator"]).strip("'")


def _tags(member: type[BaseModel]) -> tuple[str, ...]:
    """Return the values of a table's first key that say that it is this one."""
    return get_args(next(iter(member.model_fields.values())).annotation)


def _written(location: Location, model: type[BaseModel]) -> Location:
    """Return a location as a file has it: pydantic's also names which table of a union was meant."""
    return tuple(
        key
        for n, key in enumerate(location)
        if isinstance(key, int) or len(_members(_unwrapped(_annotation_at(model, location[:n])))) < 2
    )


def _annotation_at(model: object, location: Location) -> object:
    """Return the annotation at `location`, or None if the schema does not reach so far."""
    annotation = model
    for key in location:
        annotation = _unwrapped(annotation)
        if isinstance(key, int):
            items = get_args(annotation)
            annotation = items[min(key, len(items) - 1)] if items else None
            if annotation is Ellipsis:
                annotation = items[0]
        elif len(_members(annotation)) > 1:
            annotation = _tagged(annotation, key)
        else:
            field = _fields(annotation).get(key)
            is_own = field is None and annotation is model and "robot" in _fields(model)
            annotation = plugged_table(key) if is_own else None if field is None else field.annotation
    return annotation


def _field_at(model: type[BaseModel], location: Location) -> FieldInfo | None:
    if not location or not isinstance(location[-1], str):
        return None
    return _fields(_unwrapped(_annotation_at(model, location[:-1]))).get(location[-1])


def _fields(annotation: object) -> dict[str, FieldInfo]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return dict(annotation.model_fields)
    return {}


def _every_location(annotation: object, at: Location = ()) -> Iterator[Location]:
    """Yield every key of the schema that is not inside a list."""
    for key, field in _fields(_unwrapped(annotation)).items():
        yield (*at, key)
        yield from _every_location(field.annotation, (*at, key))
