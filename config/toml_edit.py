"""A TOML text with one value changed; comments, order and the writer's style stay."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, MutableMapping, Sequence
from typing import Any, TypeAlias

from pydantic_core import to_jsonable_python

TomlValue: TypeAlias = bool | int | float | str | list[Any] | dict[str, Any] | None
Place: TypeAlias = tuple[str | int, ...]


class TomlEditError(ValueError):
    """A text in which a value cannot be changed."""


def inline(value: object) -> str:
    """Return a value as in TOML, on one line: lists in brackets, tables and models in braces."""
    match value:
        case Mapping():
            pairs = (f"{_scalar({str(key): 0}).removesuffix(' = 0')} = {inline(one)}" for key, one in value.items())
            return "{" + ", ".join(pairs) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(inline, value)) + "]"
        case bool() | int() | float() | str():
            return _scalar({"x": value}).removeprefix("x = ")
        case _:  # a model, a path, an enumeration
            return inline(to_jsonable_python(value, exclude_none=True))


def _scalar(pair: Mapping[str, object]) -> str:
    import tomli_w  # here, as a start should not wait for it

    return tomli_w.dumps(pair).strip()


def with_value(text: str, place: Sequence[str | int], value: TomlValue) -> str:
    """Return a TOML text that says the same, but for one value.

    `place` leads to the value by keys and indices, and need not be there yet. A value of None is removed.

    Raises
    ------
    TomlEditError
        The text is not TOML, the place is within none of its tables, or what tomlkit makes of it says something else.
    """
    import tomlkit  # here, as a start should not wait for it

    name = ".".join(map(str, place))
    try:
        wanted = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlEditError(f"the text is not TOML: {error}") from None
    try:
        document = tomlkit.parse(text)
        for tree in (wanted, document):
            _set(tree, place, value)
        changed = tomlkit.dumps(document)
        if tomllib.loads(changed) == wanted:
            return changed
    except (AttributeError, IndexError, TypeError):
        raise TomlEditError(f"{name}: there is no such table in the text") from None
    except (tomlkit.exceptions.TOMLKitError, tomllib.TOMLDecodeError):
        pass
    raise TomlEditError(f"{name} is written in a way that no form changes: change it in the text")


def _set(tree: MutableMapping[str, Any], place: Sequence[str | int], value: TomlValue) -> None:
    """Set or remove a value; tables on the way are made, entries of lists are not."""
    at: Any = tree
    for part in place[:-1]:
        at = at.setdefault(part, {}) if isinstance(at, MutableMapping) else at[part]
    if value is None:
        at.pop(place[-1], None)
    else:
        at[place[-1]] = value
