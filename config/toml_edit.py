"""A TOML text with one value changed; comments, order and the writer's style stay.

Texts with the change in one place after another are tried: the one that says what is wanted, and nothing else, is it.
So what this does not know about TOML it refuses, and never writes wrongly.
"""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any, Final, TypeAlias

import tomli_w

Scalar: TypeAlias = bool | int | float | str | None
Place: TypeAlias = tuple[str | int, ...]

TRIED_MAX: Final = 300
"""Most texts that are tried, each of which is read anew; a file of settings has fewer values of one name."""
_VALUE: Final = r"""(?:"(?:[^"\\\n]|\\.)*"|'[^'\n]*'|[^\s,\]}#]+)"""
_LINE_END: Final = r"[ \t]*(?:#[^\n]*)?$"


class TomlEditError(ValueError):
    """A text in which a value cannot be changed."""


def with_value(text: str, place: Sequence[str | int], value: Scalar) -> str:
    """Return a TOML text that says the same, but for one value.

    Parameters
    ----------
    text
        The TOML text.
    place
        Keys of tables and indices of lists that lead to the value, which need not be there yet.
    value
        The new value; None removes it.

    Raises
    ------
    TomlEditError
        The text is not TOML, the place is within none of its tables, or the text is written in a way that is not
        known here.
    """
    try:
        wanted = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise TomlEditError(f"the text is not TOML: {error}") from None
    _set(wanted, place, value)
    for changed in islice(_tried(text, place, value), TRIED_MAX):
        try:
            found = tomllib.loads(changed)
        except tomllib.TOMLDecodeError:
            continue
        if found == wanted:
            return changed
    raise TomlEditError(
        f"{'.'.join(map(str, place))} is written in a way that no form changes: change it in the text"
    )


def _set(table: dict[str, Any], place: Sequence[str | int], value: Scalar) -> None:
    """Set or remove a value of a parsed text; tables on the way are made, entries of lists are not."""
    at: Any = table
    try:
        for part in place[:-1]:
            at = at.setdefault(part, {}) if isinstance(at, dict) else at[part]
        if value is None:
            at.pop(place[-1], None)
        else:
            at[place[-1]] = copy.copy(value)
    except (AttributeError, IndexError, TypeError):
        raise TomlEditError(f"{'.'.join(map(str, place))}: there is no such table in the text") from None


def _tried(text: str, place: Sequence[str | int], value: Scalar) -> Iterator[str]:
    """Yield texts with the change: in place of a value of this name, in each table, and in a new table."""
    yield text
    key = re.escape(str(place[-1]))
    name = rf"""(?:^|[ \t.{{,])["']?{key}["']?[ \t]*="""
    if value is None:
        line = rf"(?m)^[ \t]*(?:\S+\.)?{key}[ \t]*=[ \t]*{_VALUE}{_LINE_END}\n?"
        for removed in (line, rf",\s*{key}\s*=\s*{_VALUE}", rf"(?<={{)\s*{key}\s*=\s*{_VALUE}\s*,"):
            for found in re.finditer(removed, text):
                yield text[: found.start()] + text[found.end() :]
        return
    shown = tomli_w.dumps({"x": value}).removeprefix("x = ").strip()
    for found in re.finditer(rf"(?m){name}[ \t]*({_VALUE})", text):
        yield text[: found.start(1)] + shown + text[found.end(1) :]
    said = f"{place[-1]} = {shown}"
    for found in re.finditer(rf"(?m)^[ \t]*\[[^\n=]*\]{_LINE_END}", text):
        yield f"{text[: found.end()]}\n{said}{text[found.end() :]}"
    for found in re.finditer(r"[ \t]*\}", text):
        for before in (", ", " "):
            yield f"{text[: found.start()]}{before}{said}{text[found.start() :]}"
    if all(isinstance(part, str) for part in place):
        yield f"{text.rstrip()}\n\n[{'.'.join(map(str, place[:-1]))}]\n{said}\n".lstrip()
        yield f"{'.'.join(map(str, place))} = {shown}\n{text}"
