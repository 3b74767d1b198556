"""The line of a TOML text at which a problem of its settings lies, for an editor that shows problems beside lines."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import NamedTuple

from config.files import one_line

_PART = r"""(?:[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*')"""
_KEY = rf"{_PART}(?:\s*\.\s*{_PART})*"
_TABLE = re.compile(rf"\s*(\[\[?)\s*({_KEY})\s*\]")
_VALUE = re.compile(rf"\s*({_KEY})\s*=")
_PARTS = re.compile(_PART)
_PLACE = re.compile(r"line (\d+)(?:, column (\d+))?[^:]*: ")
_SETTING = re.compile(rf"({_KEY})(?= = |: )")
_NO_SUCH = re.compile(r'\w+ "(.+?)": no such ')
_NO_FILE = re.compile(r"(.+?): .*; named by ")
_STRING = re.compile(r'"([^"]*)"|\'([^\']*)\'')


class Problem(NamedTuple):
    """A problem of a settings text."""

    line: int | None
    """From 1; None where it lies in no line, as that of a missing table."""
    text: str
    """What is wrong, without the name of the file."""


def located(problem: str, name: str, text: str) -> Problem:
    """Return a problem of a settings text with its line.

    `problem` is a line of `config.files.ConfigError`, in which the text has this name.
    """
    said = problem.removeprefix(f"{one_line(name)}: ")
    if (place := _PLACE.match(said)) is not None:
        return Problem(int(place[1]), said[place.end() :])
    for pattern in (_NO_SUCH, _NO_FILE):
        if (named := pattern.match(said)) is not None:
            return Problem(_line_that_names(named[1], text), said)
    if said == problem or (setting := _SETTING.match(said)) is None:  # of another file, or of the text as a whole
        return Problem(None, said)
    wanted = _parts(setting[1])
    around = [(len(at), -number) for number, at in _locations(text) if at == wanted[: len(at)]]
    return Problem(-max(around)[1] if around else None, said)


def _line_that_names(name: str, text: str) -> int | None:
    """Return the first line with a string that is this name, or a path that leads to a file of this name."""
    for number, line in enumerate(text.splitlines(), start=1):
        for quoted in _STRING.findall(line.partition("#")[0]):
            said = os.path.normpath("".join(quoted))
            if name == said or name.endswith(f"{os.sep}{said.lstrip('./')}"):
                return number
    return None


def _parts(key: str) -> tuple[str, ...]:
    return tuple(part.strip("\"'") for part in _PARTS.findall(key))


def _locations(text: str) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield number and location of each line that begins a table or sets a value; entries of a list count from 0."""
    table: tuple[str, ...] = ()
    entries: dict[tuple[str, ...], int] = {}
    is_string = False
    for number, line in enumerate(text.splitlines(), start=1):
        was_string, is_string = is_string, is_string != (sum(map(line.count, ('"""', "'''"))) % 2 == 1)
        if was_string:
            continue
        if (head := _TABLE.match(line)) is not None:
            table = _within(_parts(head[2]), entries)
            if head[1] == "[[":
                entries[table] = entries.get(table, -1) + 1
                table = (*table, str(entries[table]))
            yield number, table
        elif (value := _VALUE.match(line)) is not None:
            yield number, (*table, *_parts(value[1]))


def _within(table: tuple[str, ...], entries: dict[tuple[str, ...], int]) -> tuple[str, ...]:
    """Return the location of a table whose name leads through lists: in the last entry of each."""
    found: tuple[str, ...] = ()
    for part in table:
        if found in entries:
            found = (*found, str(entries[found]))
        found = (*found, part)
    return found
