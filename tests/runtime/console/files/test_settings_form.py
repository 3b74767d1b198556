"""What installed packages have in a settings file is a form, checked by their own models and saved into the file."""

from __future__ import annotations

from pathlib import Path

import pytest
import tomlkit

from config.files import documents_read, noting_files_read
from config.load import load_settings
from config.plugins import DRIVERS, SCHEMAS
from runtime.console.commands.command_error import CommandError
from runtime.console.files.settings_files import SettingsFiles
from runtime.console.files.settings_form import form_of, with_setting
from runtime.console.sent_messages import SettingsTable
from tests.installed import install
from tests.runtime.console.files.test_settings_files import ROBOT, Run

PLUG = '''
from typing import ClassVar, Literal
from behaviors.response import Response
from behaviors.schema_call import Answer
from config.mission_step import Use
from config.strict import Strict
from pydantic import Field

class Wheels(Strict):
    """The wheels."""
    ratio: int = Field(default=2, ge=1, le=9)
    """Counts."""

class Config(Strict):
    """Of the driver "skippy".

    More.
    """
    trim: float = Field(default=1.0, gt=0.0, le=2.0)
    """Counts of the left wheel over those of the right one."""
    side: Literal["left", "right"] = "left"
    """Which one."""
    gear: Literal[1, 2] = 1
    wheels: Wheels = Wheels()
    masks: tuple[int, ...] = Field(default=(1, 2), max_length=4)
    """Which fire."""
    limits: dict[str, float] = {}
    gains: list[Wheels] = [Wheels()]

class Orbit(Use):
    """Round and round."""
    can_arrive: ClassVar[bool] = False
    name: Literal["orbit"]
    way_m: float = Field(default=1.0, gt=0.0, le=100.0)
    """That way, m."""
    def answer(self, scene, memory):
        return Answer(Response("orbit", 1.0, 0.0), memory)

from drivers.denning.family import make_device, make_driver
'''
MISSION = """name = "out"
[[step]]
name = "a"
until = {after_s = 5.0}
schemas = [{name = "noise"}, {name = "orbit", way_m = 0.5}]
"""


@pytest.fixture(autouse=True)
def _package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    entries = {DRIVERS: {"skippy": "plug_form"}, SCHEMAS: {"orbit": "plug_form:Orbit"},
               "echolocate.robots": {"skippy": "plug_robots"}}  # fmt: skip
    robot = ROBOT.read_text().replace('driver = "denning"', 'driver = "skippy"')
    files = {"plug_form.py": PLUG, "plug_robots/__init__.py": "", "plug_robots/skippy.toml": robot}
    install(monkeypatch, tmp_path / "site", files, entries)


def values(form: list[SettingsTable]) -> dict[str, object]:
    return {field["path"]: field["value"] for table in form for field in table["fields"]}


def test_a_robot_has_the_table_of_its_driver_with_what_the_file_does_not_say() -> None:
    (table,) = form_of("robots", 'robot.driver = "skippy"\n[skippy]\ntrim = 1.1\n')
    assert (table["title"], table["help"]) == ("skippy", 'Of the driver "skippy".')
    assert values([table]) == {
        "skippy.trim": 1.1, "skippy.side": "left", "skippy.gear": "1", "skippy.masks": "[1, 2]",
        "skippy.wheels.ratio": 2, "skippy.limits": "{}", "skippy.gains": "[{ratio = 2}]",
    }  # fmt: skip
    trim, side, _, _, masks, _, _ = table["fields"]
    assert (trim["kind"], trim["low"], trim["high"]) == ("float", 0.0, 2.0)
    assert trim["help"] == "Counts of the left wheel over those of the right one."
    assert side["choices"] == ["left", "right"]
    assert masks["help"] == "Which fire. As in TOML, list of integer, at most 4 long; empty: the default."


def test_files_without_such_a_table_have_no_form() -> None:
    for kind, text in (("robots", "robot = 1"), ("robots", "[ring]"), ("robots", "a = ["), ("missions", "step = [1]"),
                       ("worlds", "[skippy]"), ("missions", 'step = [{schemas = [{name = 1}, 2]}]')):  # fmt: skip
        assert form_of(kind, text) == [], text  # type: ignore[arg-type]


@pytest.mark.parametrize("value", ["1" * 5000, "1" * 20, "[" * 2000], ids=["5000 digits", "64 bits", "nested"])
def test_a_text_with_a_value_that_cannot_be_read_has_no_form(value: str) -> None:
    assert form_of("robots", f'robot.driver = "skippy"\n[skippy]\ntrim = {value}\n') == []


def test_a_mission_has_each_use_of_a_schema() -> None:
    (table,) = form_of("missions", MISSION)
    assert (table["title"], values([table])) == ("step 1, orbit", {"step.0.schemas.1.way_m": 0.5})
    changed = with_setting("missions", MISSION, "step.0.schemas.1.way_m", 0.7)
    assert changed == MISSION.replace("0.5}", "0.7}")


@pytest.mark.parametrize(
    ("said", "path", "value"),
    [
        ("masks = [7]", "skippy.masks", "[3, 4]"),
        ("gear = 1", "skippy.gear", "2"),
        ("[[skippy.gains]]\nratio = 3\n[[skippy.gains]]\nratio = 4", "skippy.gains", "[{ratio = 5}]"),
        ("limits.left = 1.0  # m/s", "skippy.limits", "{right = 2.0}"),
    ],
)
def test_a_list_is_changed_as_a_text_in_toml(said: str, path: str, value: str) -> None:
    text = f'[robot]\ndriver = "skippy"\n[skippy]\ntrim = 1.5\n{said}\n'
    changed = with_setting("robots", text, path, value)
    assert values(form_of("robots", changed))[path] == value
    assert values(form_of("robots", changed))["skippy.trim"] == 1.5
    default = with_setting("robots", changed, path, None)
    assert values(form_of("robots", default))[path] != value


@pytest.mark.parametrize("value", ["[1, ", "1\nname = 2", "", "one", pytest.param("1" * 5000, id="5000 digits")])
def test_what_is_no_value_in_toml_is_refused(value: str) -> None:
    with pytest.raises(CommandError, match=r"skippy\.masks: "):
        with_setting("robots", 'robot.driver = "skippy"', "skippy.masks", value)


async def test_a_field_is_changed_checked_by_the_plug_ins_own_model_and_saved(tmp_path: Path) -> None:
    run = Run(tmp_path)
    text = run.robot.read_text().replace('driver = "denning"', 'driver = "skippy"')
    run.robot.write_text(text)
    number = run.number("mine.toml")
    held = await run.files.read(number)
    assert values(held["form"])["skippy.trim"] == 1.0
    wrong = await run.files.changed(number, held["text"], "skippy.trim", 7.0)
    found = await run.files.check(number, wrong)
    assert [one["line"] for one in found["problems"]] == [wrong.splitlines().index("trim = 7.0") + 1]
    assert "skippy.trim" in found["problems"][0]["text"]
    assert values(found["form"])["skippy.trim"] == 7.0
    good = await run.files.changed(number, wrong, "skippy.trim", 1.5)
    assert (await run.files.check(number, good))["problems"] == []
    saved = await run.files.save(number, good, held["digest"])
    assert saved["text"] == run.robot.read_text() == f"{text.rstrip()}\n\n[skippy]\ntrim = 1.5\n"
    assert load_settings(run.config).model_extra


async def test_a_packages_own_robot_file_is_read_and_not_changed(tmp_path: Path) -> None:
    run = Run(tmp_path)
    run.config.write_text('robot = "skippy"\nworld = "hallway"\n')
    with noting_files_read():
        settings = run.load()
        files = SettingsFiles(documents_read(), settings, run.load, lambda: None)
    number = next(n for n, row in enumerate(files.listed()) if row["name"] == "robots/skippy.toml")
    assert files.listed()[number]["shipped"]
    held = await files.read(number)
    assert values(held["form"])["skippy.trim"] == 1.0
    with pytest.raises(CommandError, match="comes with the program"):
        await files.save(number, held["text"], held["digest"])


@pytest.mark.parametrize("path", ["skippy.mask", "ring.count", "skippy.name", "step.0.name"])
def test_what_is_no_field_of_the_form_is_refused(path: str) -> None:
    with pytest.raises(CommandError, match="no field of this file"):
        with_setting("robots", 'robot.driver = "skippy"', path, 1.0)


def test_a_text_that_only_a_person_can_change_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    text = 'robot.driver = "skippy"\nskippy = { side = """left""" }'
    assert with_setting("robots", text, "skippy.side", "right") == text.replace('"""left"""', '"right"')
    monkeypatch.setattr(tomlkit, "dumps", lambda _document: text)
    with pytest.raises(CommandError, match="change it in the text"):
        with_setting("robots", text, "skippy.side", "right")
