"""The reference of settings: every field of every model is in it, in words that a person can use."""

from __future__ import annotations

from typing import Literal

import pytest
from pydantic import BaseModel

from config.load import load_settings
from config.reference import FILES, Setting, default_of, markdown, settings_of, table_help, type_of
from config.settings import Settings
from config.strict import Point, TomlList

ALL = {file: list(settings_of(file)) for file, _, _ in FILES}


def paths(value: BaseModel, at: str = "") -> set[str]:
    """Return the path of every plain value within the settings of a run."""
    found = set()
    for name in type(value).model_fields:
        inner = getattr(value, name)
        found |= paths(inner, f"{at}{name}.") if isinstance(inner, BaseModel) else {f"{at}{name}"}
    return found


def test_every_setting_of_a_run_is_listed_once() -> None:
    listed = [setting.path for file in ("run", "robot") for setting in ALL[file]]
    assert len(listed) == len(set(listed))
    in_settings = {path for path in paths(load_settings("hallway")) if not path.startswith(("world.", "models"))}
    tables = {path for path in in_settings if path.count(".") < 2 and any(key.startswith(path) for key in listed)}
    unset = {
        "goal",
        "world",
        "perception.localization.known_room",
        "ring.sensors",
        "arcos",
        "rflex",
        "ros2",
        "calibration",
        "mission",
    }
    assert in_settings - set(listed) - tables - unset == set()


@pytest.mark.parametrize("setting", [s for rows in ALL.values() for s in rows], ids=lambda s: f"{s.file}:{s.path}")
def test_every_setting_has_a_type_in_words(setting: Setting) -> None:
    assert setting.type
    assert not any(code in setting.type for code in ("[", "Literal", "Optional", "typing"))


def test_a_row_says_what_the_model_says() -> None:
    row = next(s for s in ALL["run"] if s.path == "behaviors.arbiter.clearance_m")
    assert (row.type, row.bounds, row.default) == ("number", "≥ 0, ≤ 10", "0.16")
    assert row.help.startswith("Distance between rim and echo")
    assert "arbiter" in table_help("run", "behaviors.arbiter")
    assert next(s for s in ALL["run"] if s.path == "goal.x_m").help == "The place, m."
    assert next(s for s in ALL["world"] if s.path == "wall[].x1_m").default == ""


@pytest.mark.parametrize(
    ("annotation", "words"),
    [
        (float | None, "number"),
        (Literal["a", 1] | bool, '"a" or 1 or true or false'),
        (TomlList[Point], "list of list of 2 × number"),
    ],
)
def test_types_in_words(annotation: object, words: str) -> None:
    assert type_of(annotation) == words


def test_defaults_are_toml() -> None:
    assert default_of(Settings.model_fields["ring"]) == ""
    assert default_of(Settings.model_fields["goal"]) == "not set"


def test_the_page_has_every_setting() -> None:
    page = markdown()
    assert page.count("\n| `") == sum(map(len, ALL.values()))
    assert "### `[behaviors.arbiter]`" in page
    assert "### `[[wall]]`" in page
