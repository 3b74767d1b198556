"""Every field of every model: missing, of a wrong type, out of bounds, misspelt.

The cases come from the pydantic models, so that a new setting is tested without a change here. The expected messages
are composed here, independently of the code under test.
"""

from __future__ import annotations

import copy
import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

import annotated_types
import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from config.files import Document, Kind, read_document
from config.layers import Source
from config.load import ConfigError, load_mission, load_model, load_robot, load_settings, load_study, load_world
from config.mission import MissionConfig
from config.mission_step import Use
from config.model import ModelConfig
from config.robot import RobotConfig
from config.settings import Settings
from config.strict import Strict
from config.study import StudyConfig, Value
from config.world import WorldConfig
from tests.config.toml_text import MISSION, MODEL, ROBOT, RUN, STUDY, WORLD, document, irregular, toml

ROOTS: dict[str, tuple[type[BaseModel], dict[str, Any], Callable[[Path], BaseModel]]] = {
    "run": (Settings, RUN, load_settings),
    "run, ring listed": (Settings, irregular(RUN), load_settings),
    "robot": (RobotConfig, ROBOT, load_robot),
    "world": (WorldConfig, WORLD, load_world),
    "model": (ModelConfig, MODEL, load_model),
    "mission": (MissionConfig, MISSION, load_mission),
    "study": (StudyConfig, STUDY, load_study),
}
WRONG_TYPES = {"text": "oddly", "flag": True, "list": [1.5], "table": {"a": 1}, "number": 1.5, "integer": 7}
WRONG: dict[Any, tuple[str, ...]] = {
    float: ("text", "flag", "list", "table"),
    int: ("text", "flag", "list", "table", "number"),
    bool: ("text", "list", "table", "number", "integer"),
    str: ("flag", "list", "table", "number", "integer"),
    "list": ("text", "flag", "table", "number", "integer"),
    "table": ("flag", "list", "number", "integer"),  # no text: it may name a preset
    "name": ("text", "flag", "list", "table", "number"),
}
WANTED = {
    float: "must be a number",
    int: "must be an integer",
    bool: "must be true or false",
    str: "must be a string",
    "list": "must be a list",
    "table": "must be a table",
    "name": "must be one of",
}


@dataclass(frozen=True)
class Setting:
    root: str
    location: tuple[str | int, ...]
    field: FieldInfo
    kind: Any

    @property
    def path(self) -> str:
        return ".".join(map(str, self.location))

    def __str__(self) -> str:
        return f"{self.root}: {self.path}"


def inner(annotation: Any) -> Any:
    """Return an annotation without None, Annotated and Optional."""
    while True:
        arguments = [a for a in get_args(annotation) if a is not type(None)]
        if get_origin(annotation) in (tuple, Literal) or not arguments:
            return annotation
        annotation = arguments[0]


def models_within(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield every settings model within an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
        for field in annotation.model_fields.values():
            yield from models_within(field.annotation)
    for argument in get_args(annotation):
        yield from models_within(argument)


def settings_of(root: str, model: type[BaseModel], table: Any, at: tuple[str | int, ...] = ()) -> Iterator[Setting]:
    for key, field in model.model_fields.items():
        annotation = inner(field.annotation)
        location = (*at, key)
        if get_origin(annotation) is tuple:
            yield Setting(root, location, field, "list")
            if key in table:
                yield from entries_of(root, annotation, table[key], location)
        elif get_origin(annotation) is Literal:
            yield Setting(root, location, field, "name")
        elif issubclass(annotation, BaseModel):
            yield Setting(root, location, field, "table")
            if field.default is None and key not in table:
                continue  # a table that may be left out, and is
            yield from settings_of(root, annotation, table.get(key, {}), location)
        else:
            yield Setting(root, location, field, annotation)


def member(entry: Any, table: Any) -> type[BaseModel]:
    """Return the model of a table in a list, which may be one of several that its first key names."""
    for model in models_within(entry):
        first = next(iter(model.model_fields.items()))
        if table.get(first[0]) in get_args(first[1].annotation):
            return model
    return next(models_within(entry))


def entries_of(root: str, annotation: Any, table: Any, at: tuple[str | int, ...]) -> Iterator[Setting]:
    """Yield the settings of every table in a list, or of the first entry."""
    entry, location = get_args(annotation)[0], (*at, 0)
    kind = inner(entry)
    if entry == Value:
        return  # anything but a list or a table
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        for i, one in enumerate(table):
            yield from settings_of(root, member(entry, one), one, (*at, i))
        return
    if get_origin(kind) is tuple:
        yield Setting(root, location, FieldInfo.from_annotation(entry), "list")
        yield from entries_of(root, kind, table[0], location)
    else:
        yield Setting(
            root, location, FieldInfo.from_annotation(entry), "name" if get_origin(kind) is Literal else kind
        )


EVERY = [s for root, (model, table, _) in ROOTS.items() for s in settings_of(root, model, table)]
"""Every setting of every kind of file; those of a robot, a world and a model are also settings of a run."""


def distinct(every: list[Setting]) -> Iterator[Setting]:
    """Yield every field once, and from each kind of file one setting of every type."""
    fields, types = set[int](), set[tuple[str, Any]]()
    for setting in every:
        if id(setting.field) not in fields or (setting.root, setting.kind) not in types:
            yield setting
        fields.add(id(setting.field))
        types.add((setting.root, setting.kind))


SETTINGS = list(distinct(EVERY))
NAMED = [s for s in SETTINGS if isinstance(s.location[-1], str)]
"""Settings with a name; entries of lists have numbers."""
NAMES_FILES = (("models",), ("world",), ("mission",))
"""Settings of a run that may also be names, and have defaults: see test_layers."""


def is_name_of_a_file(setting: Setting) -> bool:
    """Return whether the setting may also be a name; `robot` may only in a run file."""
    return setting.location in NAMES_FILES or (setting.root.startswith("run") and setting.location == ("robot",))


def holder(table: Any, location: tuple[str | int, ...]) -> Any:
    for key in location[:-1]:
        table = table[key] if isinstance(key, int) else table.setdefault(key, {})
    return table


TEXTS = {id(value): toml(value) for _, table, _ in ROOTS.values() for value in table.values()}
"""Of what changes in none of many thousand files, by its identity."""


def refused(setting: Setting, table: dict[str, Any], folder: Path) -> list[str]:
    path, texts = folder / "mine.toml", ((key, TEXTS.get(id(it)) or toml(it)) for key, it in table.items())
    path.write_text("".join(f"{key} = {text}\n" for key, text in texts), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        ROOTS[setting.root][2](path)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(f"{path}: ") for line in lines)
    return [line.removeprefix(f"{path}: ") for line in lines]


def test_every_section_is_reached() -> None:
    paths = {s.path for s in EVERY if s.root.startswith("run")}
    assert {"ring.count", "ring.sensors.0.angle_deg", "ring.firing.sets", "body.synchro", "link.tries"} <= paths
    assert {"world.drum.0.x_m", "world.polygon.0.vertices_m", "models.0.arc_radius_m", "log.level"} <= paths
    assert {"perception.relaxation.gamma", "behaviors.arbiter.turn_gain_per_s", "cycle.rate_hz"} <= paths
    assert len(paths) > 90


def strict_models(base: type[Strict] = Strict) -> Iterator[type[Strict]]:
    for model in base.__subclasses__():
        if model is not Use:  # which no file holds: it is what each schema's settings inherit
            yield model
        yield from strict_models(model)


@pytest.mark.promise("P11")
def test_no_field_of_any_model_is_left_out(measured: Callable[[str], None]) -> None:
    """A field that the tables above do not reach is a failure."""
    every = {model for root, _, _ in ROOTS.values() for model in models_within(root)}
    shipped = {m for m in strict_models() if m.__module__.startswith("config.")}
    assert shipped <= every, "a settings model that no file can hold"
    wanted = {id(field) for model in every for field in model.model_fields.values()}
    assert wanted <= {id(s.field) for s in SETTINGS}
    types = sum(len(WRONG[s.kind]) for s in SETTINGS if not is_name_of_a_file(s))
    cases = types + len(REQUIRED) + len(NAMED) + len(list(bounds()))
    measured(f"{len(wanted)} fields of {len(every)} models, {cases} invalid tables, each reported in a line")


@pytest.mark.promise("P11")
def test_every_number_has_a_lower_and_an_upper_bound() -> None:
    """Otherwise a mistyped number causes an overflow far from its file."""
    for setting in SETTINGS:
        if setting.kind in (int, float):
            bounds = [type(bound) for bound in setting.field.metadata]
            assert {annotated_types.Ge, annotated_types.Gt} & {*bounds}, f"{setting} has no lower bound"
            assert {annotated_types.Le, annotated_types.Lt} & {*bounds}, f"{setting} has no upper bound"


@pytest.mark.parametrize("root", ROOTS)
def test_the_unchanged_table_is_valid(root: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(document(ROOTS[root][1]), encoding="utf-8")
    ROOTS[root][2](tmp_path / "mine.toml")


def changed(setting: Setting, value: object) -> dict[str, Any]:
    """Return the valid table of a kind of file with another value for one setting; the others are not copied."""
    table = copy.copy(ROOTS[setting.root][1])
    at: Any = table
    for key in setting.location[:-1]:
        at[key] = copy.copy(at[key] if isinstance(key, int) else at.get(key, {}))
        at = at[key]
    at[setting.location[-1]] = value
    return table


def assert_one_line(setting: Setting, table: dict[str, Any], folder: Path, expected: str) -> None:
    lines = refused(setting, table, folder)
    assert len(lines) == 1, (str(setting), lines)
    assert lines[0].startswith(expected), str(setting)


@pytest.mark.promise("P11")
@pytest.mark.parametrize("root", ROOTS)
def test_wrong_type(root: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each setting meets each wrong type, in memory: files of them all would take most of the time."""
    path, table = Path("mine.toml"), dict[str, Any]()

    def read(kind: Kind, name: str | Path, named_by: Source | None = None) -> Document:
        return Document(table, Source(str(path))) if name == path else read_document(kind, name, named_by)

    monkeypatch.setattr("config.load.read_document", read)
    for setting in (s for s in SETTINGS if s.root == root and not is_name_of_a_file(s)):
        for given in WRONG[setting.kind]:
            table = changed(setting, WRONG_TYPES[given])
            shown = "{…}" if given == "table" else toml(WRONG_TYPES[given])
            with pytest.raises(ConfigError) as caught:
                ROOTS[root][2](path)
            (line,) = str(caught.value).splitlines()
            assert line.startswith(f"{path}: {setting.path} = {shown}: {WANTED[setting.kind]}"), str(setting)


REQUIRED = [s for s in NAMED if s.field.is_required() and s.location not in NAMES_FILES]


@pytest.mark.promise("P11")
@pytest.mark.parametrize("root", ROOTS)
def test_missing(root: str, tmp_path: Path) -> None:
    for setting in (s for s in REQUIRED if s.root == root):
        table = copy.deepcopy(ROOTS[setting.root][1])
        del holder(table, setting.location)[setting.location[-1]]
        (line,) = refused(setting, table, tmp_path)
        assert line.partition("; must be one of ")[0] == f"{setting.path}: missing"


@pytest.mark.compiled
@pytest.mark.promise("P11")
@pytest.mark.parametrize("root", ROOTS)
def test_misspelt(root: str, tmp_path: Path) -> None:
    for setting in (s for s in NAMED if s.root == root):
        key = str(setting.location[-1])
        misspelt = f"{key[:-1]}q{key[-1]}"
        table = copy.deepcopy(ROOTS[setting.root][1])
        holder(table, setting.location)[misspelt] = 1
        path = ".".join(map(str, (*setting.location[:-1], misspelt)))
        assert refused(setting, table, tmp_path) == [f"{path}: unknown key; did you mean {key}?"]


def bounds() -> Iterator[tuple[Setting, float, str]]:
    """Yield each numeric setting with a value beyond each of its bounds, and the expected start of the message."""
    for setting in SETTINGS:
        step = 1 if setting.kind is int else 0.001
        for bound in setting.field.metadata if setting.kind in (int, float) else ():
            constraint: Any = bound
            match bound:
                case annotated_types.Gt():
                    yield setting, constraint.gt, f"must be above {constraint.gt:g}"
                case annotated_types.Ge():
                    yield setting, constraint.ge - step, "must be at least "
                case annotated_types.Lt():
                    yield setting, constraint.lt, f"must be below {constraint.lt:g}"
                case annotated_types.Le():
                    yield setting, constraint.le + step, "must be at most "


@pytest.mark.compiled
@pytest.mark.promise("P11")
def test_out_of_bounds(tmp_path: Path) -> None:
    for setting, value, wanted in bounds():
        assert_one_line(setting, changed(setting, value), tmp_path, f"{setting.path} = {value}: {wanted}")


NUMBERS = [s for s in SETTINGS if s.kind is float]


@pytest.mark.compiled
@pytest.mark.parametrize("each", [1, pytest.param(3, marks=pytest.mark.soak)])
def test_neither_infinite_nor_nan(each: int, tmp_path: Path) -> None:
    """The short form tries one of the three on each, in turn."""
    values = itertools.cycle((float("inf"), float("-inf"), float("nan")))
    for setting in NUMBERS:
        for value in itertools.islice(values, each):
            assert_one_line(setting, changed(setting, value), tmp_path, f"{setting.path} = {value}: must be ")


def test_a_number_may_be_written_without_a_fraction(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    for setting in NUMBERS:
        path.write_text(document(changed(setting, 1)), encoding="utf-8")
        try:
            ROOTS[setting.root][2](path)
        except ConfigError as error:
            assert "must be a number" not in str(error)  # noqa: PT017 - other rules may refuse a value
