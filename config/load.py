"""Loading of settings from files, names and `--set`: returns valid settings or raises a ConfigError.

Layers, the lower first: the robot file, the run file, single settings from the command line. The world and the
models are separate files that the run file names.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from config.files import ConfigError, Kind, dotted, list_shipped, one_line, parse_document, read_document
from config.layers import Layers, Location, PathError, Source
from config.mission import MissionConfig
from config.model import ModelConfig
from config.overrides import apply_overrides, parse_override, parse_overrides
from config.places import check_places
from config.plugins import plugged_table
from config.problems import describe_errors, given_type, shown, unknown_key
from config.robot import RobotConfig
from config.settings import MODELS_MAX, GoalConfig, Settings
from config.strict import Strict
from config.study import StudyConfig
from config.world import WorldConfig

__all__ = [
    "ConfigError",
    "list_shipped",
    "load_any",
    "load_mission",
    "load_model",
    "load_robot",
    "load_settings",
    "load_study",
    "load_world",
    "override_settings",
    "parse_text",
    "with_goal",
    "with_known_room",
    "with_mission",
    "with_room",
    "with_value",
]

DEFAULT_RUN = DEFAULT_WORLD = "hallway"
DEFAULT_MODEL = "semicircle"
"""The paper's experiment: defaults of a run whose file does not name them."""
COMMAND_LINE = Source("command line")
NAMES = ("robot", "world", "models", "mission")
"""Keys of a run file that name other files; `robot` may also be a section."""
M = TypeVar("M", bound=BaseModel)


def load_robot(name_or_path: str | os.PathLike[str]) -> RobotConfig:
    """Return the robot of a shipped name or a file; raise ConfigError if it is unreadable or invalid."""
    return _load("robots", name_or_path, RobotConfig)


def load_world(name_or_path: str | os.PathLike[str]) -> WorldConfig:
    """Return the world of a shipped name or a file; raise ConfigError if it is unreadable or invalid."""
    return _load("worlds", name_or_path, WorldConfig)


def load_model(name_or_path: str | os.PathLike[str]) -> ModelConfig:
    """Return the object model of a shipped name or a file; raise ConfigError if it is unreadable or invalid."""
    return _load("models", name_or_path, ModelConfig)


def load_mission(name_or_path: str | os.PathLike[str]) -> MissionConfig:
    """Return the mission of a shipped name or a file; raise ConfigError if it is unreadable or invalid."""
    return _load("missions", name_or_path, MissionConfig)


def load_study(name_or_path: str | os.PathLike[str]) -> StudyConfig:
    """Return the study of a shipped name or a file; raise ConfigError if it is unreadable or invalid."""
    return _load("studies", name_or_path, StudyConfig)


def load_any(name_or_path: str | os.PathLike[str], overrides: Sequence[str] = ()) -> Strict:
    """Return the run, world, model, mission or study of a file, by its top-level keys; a robot's as a run with it.

    A name is that of a shipped or installed run or, where there is none, of a robot, mission, world or model.

    Raises
    ------
    ConfigError
        The file cannot be read or is invalid.
    """
    by_name: tuple[Kind, ...] = ("runs", "robots", "missions", "worlds", "models")
    named = next((kind for kind in by_name if name_or_path in list_shipped(kind)), None)
    if named == "robots":
        return load_settings(None, overrides, robot=str(name_or_path))
    table = read_document(named or "runs", name_or_path).table
    kinds: dict[type[Strict], Kind] = {Settings: "runs", ModelConfig: "models", WorldConfig: "worlds",
                                       MissionConfig: "missions", StudyConfig: "studies"}  # fmt: skip
    kind = max(kinds, key=lambda one: len(table.keys() & {*one.model_fields, *(NAMES if one is Settings else ())}))
    if kind is Settings or overrides:
        return load_settings(name_or_path, overrides)
    return _load(kinds[kind], name_or_path if named else Path(name_or_path), kind)


def load_settings(
    config: str | os.PathLike[str] | None = None,
    overrides: Sequence[str] = (),
    *,
    robot: str | None = None,
    world: str | None = None,
    models: Sequence[str] = (),
    mission: str | None = None,
) -> Settings:
    """Return all settings of a run.

    Parameters
    ----------
    config
        Name or path of a run file; by default the shipped hallway run.
    overrides
        Texts of the form ``dotted.path=value``, each on top of the ones before it.
    robot, world, models, mission
        Names or paths, instead of those in the run file.

    Raises
    ------
    ConfigError
        With a line for each problem, naming the file or ``--set`` the value came from.
    """
    run = read_document("runs", DEFAULT_RUN if config is None else config)
    of_names, of_values, problems = parse_overrides(overrides)
    names = Layers(run.source)
    names.lay({"world": DEFAULT_WORLD, "models": [DEFAULT_MODEL]}, run.source)
    section = ("robot",) if isinstance(run.table.get("robot"), dict) else ()
    names.lay({key: run.table[key] for key in NAMES if key in run.table and key not in section}, run.source)
    asked = {"robot": robot, "world": world, "models": list(models) or None, "mission": mission}
    names.lay({key: value for key, value in asked.items() if value is not None}, COMMAND_LINE)
    if isinstance(names.tree["models"], str):
        names.lay({"models": [names.tree["models"]]}, names.source_of(("models",)))
    problems += apply_overrides(of_names, names)

    settings = Layers(run.source)
    if "robot" in names.tree:
        settings, more = _robot_layer(names)
        problems += more
    elif "ring" not in run.table and "body" not in run.table:
        known = ", ".join(list_shipped("robots"))
        problems.append(f"{run.source.name}: robot: missing; name a robot or a robot file; known robots: {known}")
    settings.lay({key: value for key, value in run.table.items() if key not in NAMES or key in section}, run.source)
    problems += _lay_named("worlds", "world", names, settings)
    problems += _lay_models(names, settings)
    if "mission" in names.tree:
        problems += _lay_named("missions", "mission", names, settings)
    problems += apply_overrides(of_values, settings)
    if problems:
        raise ConfigError(*problems)
    return _validated(Settings, settings)


def override_settings(settings: Settings, name: str, overrides: Sequence[str]) -> Settings:
    """Return complete settings with single values overridden.

    Each override is ``dotted.path=value``; `name` is that of the settings' source in error messages.

    Raises
    ------
    ConfigError
        With a line for each problem.
    """
    source = Source(name)
    layers = Layers(source)
    layers.lay(settings.model_dump(mode="json"), source)
    changes = [parse_override(text) for text in overrides]
    files = [change for change in changes if change.names_files]
    if files:
        raise ConfigError(f"--set {dotted(files[0].location)}: names a file; that goes with a run file only")
    problems = apply_overrides(changes, layers)
    if problems:
        raise ConfigError(*problems)
    return _validated(Settings, layers)


def with_known_room(settings: Settings, name_or_path: str | os.PathLike[str]) -> Settings:
    """Return the settings with the surfaces of a world as the known room, and with its places if it has any.

    Raises
    ------
    ConfigError
        The world cannot be read, is invalid, or has no surface; or drift is to be corrected otherwise.
    """
    room, name = load_world(name_or_path), f"map {os.fspath(name_or_path)}"
    places = room.places() if room.has_any else settings.places
    return with_room(settings.model_copy(update={"places": places}), room, name)


def with_room(settings: Settings, room: WorldConfig | None, name: str) -> Settings:
    """Return the settings with the surfaces of a world as the known room, or without a known room.

    A room of None is no known room; `name` is that of the map in error messages.

    Raises
    ------
    ConfigError
        The world has no surface; or drift is to be corrected otherwise.
    """
    surfaces = None if room is None else room.model_dump(mode="json", include={"drum", "wall", "box", "polygon"})
    return with_value(settings, name, ("perception", "localization", "known_room"), surfaces)


def with_goal(settings: Settings, goal: GoalConfig) -> Settings:
    """Return the settings with a goal in place of their own goal or mission.

    Raises
    ------
    ConfigError
        A value is out of its bounds.
    """
    free = settings.model_copy(update={"goal": None, "mission": None})
    return with_value(free, "goal", ("goal",), goal.model_dump(mode="json"))


def with_mission(settings: Settings, mission: MissionConfig) -> Settings:
    """Return the settings with a mission in place of their own goal or mission.

    Raises
    ------
    ConfigError
        It looks for an object that these settings do not recognise, or drives to a place that they do not name.
    """
    free = settings.model_copy(update={"goal": None, "mission": None})
    check_places(mission, settings.places)
    return with_value(free, f"mission {mission.name}", ("mission",), mission.model_dump(mode="json"))


def with_value(settings: Settings, name: str, location: Location, value: object) -> Settings:
    """Return complete settings with one value replaced.

    The value is as a file would hold it, None where it is not given; `name` is that of its source in error messages.

    Raises
    ------
    ConfigError
        With a line for each problem.
    """
    source = Source(name)
    layers = Layers(source)
    layers.lay(settings.model_dump(mode="json"), source)
    try:
        layers.put(location, value, source)
    except PathError as error:
        raise ConfigError(f"{name}: {dotted(location)}: {one_line(str(error))}") from None
    return _validated(Settings, layers)


def parse_text(model: type[M], text: str, name: str) -> M:
    """Return the object model, mission or world of a TOML text, called `name` in error messages.

    Raises
    ------
    ConfigError
        The text is not TOML, or not of this kind.
    """
    source = Source(name)
    layers = Layers(source)
    layers.lay(parse_document(text.encode("utf-8", "surrogatepass"), name), source)
    return _validated(model, layers)


def _load(kind: Kind, name: str | os.PathLike[str], model: type[M]) -> M:
    document = read_document(kind, name)
    layers = Layers(document.source)
    layers.lay(document.table, document.source)
    return _validated(model, layers)


def _validated(model: type[M], layers: Layers) -> M:
    try:
        return model.model_validate(layers.tree)
    except ValidationError as error:
        raise ConfigError(*describe_errors(error, layers, model)) from None


def _robot_layer(names: Layers) -> tuple[Layers, list[str]]:
    """Return the lowest layer, that of the robot file, and the problems of its top level.

    They are checked here because a section that a robot file must not have is valid once merged with a run file.
    """
    named_by, name = names.source_of(("robot",)), names.tree["robot"]
    if not isinstance(name, str):
        return Layers(named_by), [_not_a_name("robot", name, named_by)]
    try:
        document = read_document("robots", name, named_by)
    except ConfigError as error:
        return Layers(named_by), list(error.problems)
    source, table = document.source, document.table
    stray = [key for key in table if key not in RobotConfig.model_fields and plugged_table(key) is None]
    layers = Layers(source)
    layers.lay({key: value for key, value in table.items() if key not in stray}, source)
    return layers, [f"{source.name}: {dotted((key,))}: {unknown_key((key,), RobotConfig)}" for key in stray]


def _lay_named(kind: Kind, key: str, names: Layers, settings: Layers) -> list[str]:
    """Lay the table of a world or a mission, and return its problems."""
    named_by, name = names.source_of((key,)), names.tree[key]
    table, source, problems = _named_table(kind, (key,), name, named_by)
    if not problems:
        settings.put((key,), table, source)
    return problems


def _lay_models(names: Layers, settings: Layers) -> list[str]:
    """Put the tables of the named models into the settings; return the problems met."""
    named_by, models = names.source_of(("models",)), names.tree["models"]
    if isinstance(models, str):
        models = [models]
    if not isinstance(models, list):
        return [f"{named_by.name}: models = {shown(models)}: must be a list of names, not {given_type(models)}"]
    if len(models) > MODELS_MAX:
        return [f"{named_by.name}: models: may have at most {MODELS_MAX} entries, has {len(models)}"]
    settings.put(("models",), [None] * len(models), named_by)
    problems = []
    for i, model in enumerate(models):
        named_by = names.source_of(("models", i))
        table, source, more = _named_table("models", ("models", i), model, named_by)
        if not more:
            settings.put(("models", i), table, source)
        problems += more
    return problems


def _named_table(kind: Kind, at: Location, value: object, by: Source) -> tuple[dict[str, Any], Source, list[str]]:
    """Return the table that `value`, which stands `at` this location, is or names; its source; and its problems."""
    if isinstance(value, dict):
        return value, by, []
    if not isinstance(value, str):
        return {}, by, [_not_a_name(dotted(at), value, by)]
    try:
        document = read_document(kind, value, by)
    except ConfigError as error:
        return {}, by, list(error.problems)
    return document.table, document.source.mounted(at), []


def _not_a_name(key: str, value: object, source: Source) -> str:
    return f"{source.name}: {key} = {shown(value)}: must be a name or a path (a string), not {given_type(value)}"
