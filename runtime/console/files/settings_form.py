"""Forms for the tables that installed packages have in a settings file, made from the packages' own models."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from config.errors import UserError
from config.files import ConfigError, Kind, parse_toml
from config.layers import Location
from config.plugins import DRIVERS, plugged, plugged_table, plugged_use
from config.toml_edit import TomlEditError, TomlValue, with_value
from runtime.console.commands.command_error import CommandError
from runtime.console.commands.parameters import TOML, fields_of
from runtime.console.sent_messages import SettingsTable


def form_of(kind: Kind, text: str) -> list[SettingsTable]:
    """Return a form for each table of an installed package in a text; none where it is not TOML.

    A robot file, or a run file with a robot in it, has the table of its driver; a mission has each use of a schema.

    The text need not be valid.
    """
    try:
        found = _tables(kind, parse_toml(text, "text"))
        return [_table(place, model, values) for place, model, values in found]
    except UserError:  # the text or a package is wrong, which the check of the text says
        return []


def with_setting(kind: Kind, text: str, path: str, value: TomlValue) -> str:
    """Return a text with another value of a field of its form; what that means, the check says.

    A value of None removes the key, so that its default counts. A list and the like is a text in TOML.

    Raises
    ------
    CommandError
        There is no such field, its text is not TOML, or the file's is written so that only a person can change it.
    """
    fields = {field["path"]: field for table in form_of(kind, text) for field in table["fields"]}
    if path not in fields:
        raise CommandError(f"{path}: no field of this file's form; change the text")
    if fields[path]["kind"] == TOML and value is not None:
        value = _read(path, str(value))
    place = [int(part) if part.isdecimal() else part for part in path.split(".")]
    try:
        return with_value(text, place, value)
    except TomlEditError as error:
        raise CommandError(str(error)) from None


def _read(path: str, text: str) -> TomlValue:
    """Return the value that a text in TOML says.

    Raises
    ------
    CommandError
        It says none, or several.
    """
    try:
        said = parse_toml(f"value = {text}", "the value")
    except ConfigError:
        raise CommandError(f"{path}: not a value in TOML; write it as [1, 2] or [{{name = 1}}]") from None
    if len(said) > 1:
        raise CommandError(f"{path}: more than one value; write it as [1, 2] or [{{name = 1}}]")
    value: TomlValue = said["value"]
    return value


def _tables(kind: Kind, document: dict[str, Any]) -> Iterator[tuple[Location, type[BaseModel], dict[str, Any]]]:
    """Yield place, model and content of each table that a package has or may have in a file."""
    if kind in {"robots", "runs"}:
        robot = document.get("robot")
        driver = robot.get("driver") if isinstance(robot, dict) else None
        for name in plugged(DRIVERS):
            if (name == driver or name in document) and (table := plugged_table(name)) is not None:
                values = document.get(name)
                yield (name,), table, values if isinstance(values, dict) else {}
    for i, step in enumerate(_list(document.get("step")) if kind == "missions" else ()):
        for j, use in enumerate(_list(step.get("schemas"))):
            named = use.get("name")
            if isinstance(named, str) and (schema := plugged_use(named)) is not None:
                yield ("step", i, "schemas", j), schema, use


def _list(value: object) -> list[dict[str, Any]]:
    """Return the tables of a list, with an empty one for what is none."""
    return [one if isinstance(one, dict) else {} for one in value] if isinstance(value, list) else []


def _table(place: Location, model: type[BaseModel], values: dict[str, Any]) -> SettingsTable:
    title = str(place[0]) if len(place) == 1 else f"step {int(place[1]) + 1}, {values['name']}"
    text = " ".join((model.__doc__ or "").split("\n\n")[0].split())
    return {"title": title, "help": text, "fields": list(fields_of(model, values, place))}
