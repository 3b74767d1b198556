"""What installed packages add by their entry points: drivers, schemas, and files of settings (docs/extending.md).

Nothing of a package is imported before a file names it. Names that are shipped take precedence.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Final, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import InitErrorDetails, to_json

from config.errors import WRONG_CALL, UserError

M = TypeVar("M", bound=BaseModel)
DRIVERS: Final = "echolocate.drivers"
"""Each names a module with the functions of `drivers.registry.DriverFamily`; its class `Config` is the driver's own
table in a robot file."""
SCHEMAS: Final = "echolocate.schemas"
"""Each names a subclass of `config.mission_step.Use` that has a method `answer`."""
FILES: Final = "echolocate.{}"
"""With the kind of the files, as `echolocate.models`: each names a package whose folder holds such TOML files."""


class PluginError(UserError):
    """An installed package does not provide what its entry point says."""

    exit_code = WRONG_CALL


def plugged(group: str) -> dict[str, EntryPoint]:
    """Return the installed entry points of a group by name."""
    return {**_installed(tuple(map(_state_of, sys.path))).get(group, {})}


def _state_of(place: str) -> tuple[str, int, int]:
    """Return a place where packages are, which of all folders it is, and when something was last installed there."""
    try:
        found = os.stat(place or os.curdir)  # noqa: PTH116 - a Path takes ten times as long
    except (OSError, ValueError):
        return place, 0, 0
    return place, found.st_ino, found.st_mtime_ns


@lru_cache(maxsize=4)
def _installed(_places: tuple[tuple[str, int, int], ...]) -> dict[str, dict[str, EntryPoint]]:
    """Return our groups of entry points. To look for them takes as long as all else when settings are loaded."""
    every = entry_points()
    ours = [group for group in every.groups if group.startswith(FILES.format(""))]
    return {group: {entry.name: entry for entry in every.select(group=group)} for group in ours}


def load_plugin(entry: EntryPoint) -> object:
    """Return what an entry point names.

    Raises
    ------
    PluginError
        It cannot be imported, or fails as it is; the text has the error of the package's own code.
    """
    found, why = None, None
    try:
        module = EntryPoint(entry.name, entry.module, entry.group).load()
        if hasattr(module, "__path__") and getattr(module, "__file__", None) is None:
            why = f"the folder {next(iter(module.__path__))} hides it: start Python in another folder"
        else:
            found = entry.load()
    except (ImportError, AttributeError, SyntaxError) as error:
        why = str(error)
    except Exception as error:  # noqa: BLE001 - a package's module may raise anything
        frames = traceback.extract_tb(error.__traceback__)
        package = entry.module.partition(".")[0]
        at = next(
            (one for one in reversed(frames) if package in Path(one.filename).with_suffix("").parts), frames[-1]
        )
        why = f"{type(error).__name__}: {' '.join(str(error).split())}, at {at.filename}:{at.lineno}"
    if why is not None:
        raise PluginError(
            f'the plug-in "{entry.name}" cannot be loaded from {entry.value} ({why}); reinstall or update the '
            f"package that provides it"
        )
    return found


def plugged_folders(kind: str) -> tuple[list[Traversable], str]:
    """Return the folders of files that packages add to a kind, and a sentence on those that are missing."""
    folders, lacking = [], ""
    for name, entry in plugged(FILES.format(kind)).items():
        try:
            folders.append(files(entry.value))
        except ImportError:
            lacking += f'; the plug-in "{name}" has no package {entry.value}: reinstall it'
    return folders, lacking


def plugged_table(name: str) -> type[BaseModel] | None:
    """Return the model of an installed driver's own table in a robot file; None if there is none of this name."""
    entry = plugged(DRIVERS).get(name)
    model = None if entry is None else getattr(load_plugin(entry), "Config", None)
    return model if isinstance(model, type) and issubclass(model, BaseModel) else None


def plugged_use(name: str) -> type[BaseModel] | None:
    """Return an installed schema of this name with its settings, None if there is none.

    Raises
    ------
    PluginError
        It is no schema.
    """
    entry = plugged(SCHEMAS).get(name)
    if entry is None:
        return None
    use = load_plugin(entry)
    if isinstance(use, type) and issubclass(use, BaseModel) and callable(getattr(use, "answer", None)):
        return use
    raise PluginError(
        f'the schema "{name}" of {entry.value} is none: it needs a subclass of config.mission_step.Use with a method '
        f"answer; correct or update the package that provides it"
    )


def validated(model: type[M], value: object) -> M:
    """Return a package's own table as its model, whose fields may have any type that TOML can write.

    A strict model takes a list for a tuple, and a text for a path or an enumeration, only from JSON.

    Raises
    ------
    pydantic.ValidationError
        The table is wrong.
    """
    return model.model_validate_json(to_json(value)) if isinstance(value, dict) else model.model_validate(value)


def located(error: ValidationError, *at: str | int) -> Iterable[InitErrorDetails]:
    """Yield the problems of a table that was validated by itself, each at its place in the table that holds it."""
    for found in error.errors(include_url=False):
        details = InitErrorDetails(type=found["type"], loc=(*at, *found["loc"]), input=found["input"])
        yield InitErrorDetails(**details, ctx=found["ctx"]) if "ctx" in found else details


def _lacking(model: type[BaseModel], data: object) -> list[InitErrorDetails]:
    """Return what a robot file without a table of its installed driver lacks; a table of defaults may be left out."""
    robot = data.get("robot") if isinstance(data, dict) else None
    name = robot.get("driver") if isinstance(robot, dict) else None
    if not isinstance(data, dict) or not isinstance(name, str) or name in {*data, *model.model_fields}:
        return []
    try:
        if (table := plugged_table(name)) is not None:
            validated(table, {})
    except ValidationError as error:
        return list(located(error, name))
    except PluginError:  # the registry of drivers says it
        pass
    return []


def with_own_tables(model: type[M], data: object, validate: Callable[[object], M]) -> M:
    """Return a robot file whose further tables are validated by the installed drivers of these names.

    `model` is the robot file's; `validate` validates its own fields.

    Raises
    ------
    pydantic.ValidationError
        A field or a table is wrong, or no driver has a table of this name.
    """
    own = {key: data[key] for key in data if key not in model.model_fields} if isinstance(data, dict) else {}
    lacking = _lacking(model, data)
    if not isinstance(data, dict) or not (own or lacking):
        return validate(data)
    problems, tables, config = lacking, dict[str, BaseModel](), None
    try:
        config = validate({key: value for key, value in data.items() if key not in own})
    except ValidationError as error:
        problems += located(error)
    for key, value in own.items():
        table = plugged_table(key)
        if table is None:
            problems.append(InitErrorDetails(type="extra_forbidden", loc=(key,), input=value))
            continue
        try:
            tables[key] = validated(table, value)
        except ValidationError as error:
            problems += located(error, key)
    if problems or config is None:
        raise ValidationError.from_exception_data(model.__name__, problems)
    return config.model_copy(update=tables)
