"""What an installed package adds is known by its name, checked by its own model, and named where it is wrong."""

from __future__ import annotations

import os
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from config.files import ConfigError, list_shipped
from config.load import load_any, load_model, load_robot, load_settings, override_settings
from config.plugins import DRIVERS, PluginError, plugged, plugged_use
from config.reference import markdown, settings_of
from config.settings import Settings
from tests.installed import install

FAMILY = '''
"""A family."""
from pydantic import Field
from config.strict import Strict

class Config(Strict):
    """Of the driver "skippy"."""
    trim: float = Field(default=1.0, gt=0.0, le=2.0)
    """Counts of the left wheel over those of the right one."""
'''
LISTS = (
    FAMILY
    + """
    masks: tuple[int, ...] = ()
    log: Path | None = None
    side: Side = Side.LEFT
    gains: list[Gain] = []
    limits: dict[str, float] = {}
"""
)
LISTS = LISTS.replace("from pydantic", "from enum import Enum\nfrom pathlib import Path\nfrom pydantic").replace(
    "class Config", "class Side(Enum):\n    LEFT = 'l'\n\nclass Gain(Strict):\n    ratio: int = 1\n\nclass Config"
)
CRATE = 'name = "tub"\nclosed = true\nvertices_m = [[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]]\n'
ROBOT = """
[robot]
driver = "skippy"
[ring]
count = 6
radius_m = 0.1
beam_half_angle_deg = 15.0
resolution_m = 0.01
range_min_m = 0.05
range_max_m = 3.0
firing = "single"
[body]
radius_m = 0.12
speed_max_m_s = 0.25
turn_max_rad_s = 1.0
"""


@pytest.fixture(autouse=True)
def _package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    files = {
        "plug_family.py": FAMILY, "plug_lists.py": LISTS, "plug_wants.py": FAMILY.replace("default=1.0, ", ""),
        "plug_broken.py": "import plug_missing\n", "plug_data/__init__.py": "",
        "plug_raises.py": "\nlimit = 1 / 0\n", "plug_typo.py": "limit = = 1\n",
        "plug_data/models/tub.toml": CRATE, "plug_data/robots/skippy.toml": ROBOT + "[skippy]\ntrim = 1.1\n",
        "plug_data/models/drum.toml": CRATE, "plug_hidden/plug_hidden/__init__.py": FAMILY,
    }  # fmt: skip
    install(monkeypatch, tmp_path / "site", files, {
        DRIVERS: {"skippy": "plug_family", "wants": "plug_wants", "lists": "plug_lists", "broken": "plug_broken",
                  "hidden": "plug_hidden", "raises": "plug_raises", "typo": "plug_typo"},
        "echolocate.schemas": {"none": "plug_family"},
        "echolocate.models": {"mine": "plug_data.models", "gone": "plug_gone.models"},
        "echolocate.robots": {"mine": "plug_data.robots"},
    })  # fmt: skip


def test_files_are_known_by_name_and_a_shipped_one_comes_first() -> None:
    assert {"tub", "drum"} <= set(list_shipped("models"))
    assert load_model("tub").name == "tub"
    assert load_model("drum").name == "drum"
    assert "skippy" in list_shipped("robots")
    with pytest.raises(ConfigError, match=r'the plug-in "gone" has no package plug_gone\.models: reinstall it'):
        load_model("tubb")


def test_a_drivers_own_table_is_validated_by_its_own_model_and_goes_with_the_settings(tmp_path: Path) -> None:
    robot = load_robot("skippy")
    assert robot.model_dump()["skippy"] == {"trim": 1.1}
    settings = load_settings(None, ["skippy.trim=1.2"], robot="skippy")
    assert settings.model_dump(mode="json")["skippy"] == {"trim": 1.2}
    assert Settings.model_validate(settings.model_dump()) == settings
    assert override_settings(settings, "x", ["skippy.trim=1.3"]).model_dump()["skippy"] == {"trim": 1.3}
    plain = tmp_path / "plain.toml"
    plain.write_text(ROBOT)
    assert "skippy" not in load_robot(plain).model_dump()


def test_a_table_may_have_any_type_that_toml_can_write(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    text = '[lists]\nmasks = [1, 2]\nlog = "a.txt"\nside = "l"\ngains = [{ratio = 3}]\nlimits = {v = 2}\n'
    path.write_text(ROBOT.replace('"skippy"', '"lists"') + text)
    robot = load_robot(path)
    held = {"trim": 1.0, "masks": [1, 2], "log": "a.txt", "side": "l", "gains": [{"ratio": 3}], "limits": {"v": 2.0}}
    assert robot.model_dump(mode="json")["lists"] == held
    assert type(robot).model_validate(robot.model_dump(mode="json")) == type(robot).model_validate(robot.model_dump())
    path.write_text(path.read_text().replace("masks = [1, 2]", "masks = [1, 2.5]"))
    with pytest.raises(ConfigError, match=r"lists.masks.1 = 2.5: must be an integer"):
        load_robot(path)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[skippy]\ntrim = 3.0\n", "skippy.trim = 3.0: must be at most 2"),
        ("[skippy]\ntrimm = 1.0\n", "skippy.trimm: unknown key; did you mean trim?"),
        ("[skipy]\ntrim = 1.0\n", "skipy: unknown key"),
        ("[broken]\ntrim = 1.0\n", 'the plug-in "broken" cannot be loaded'),
        ("[hidden]\ntrim = 1.0\n", "plug_hidden hides it: start Python in another folder"),
        ("[raises]\ntrim = 1.0\n", "plug_raises (ZeroDivisionError: division by zero, at "),
        ("[typo]\ntrim = 1.0\n", "cannot be loaded from plug_typo (invalid syntax (plug_typo.py, line 1))"),
    ],
)
def test_what_is_wrong_in_it_is_named_with_its_place(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT + text)
    for load in (load_robot, load_any):
        with pytest.raises((ConfigError, PluginError)) as caught:
            load(path)
        assert said in str(caught.value)


def test_a_table_that_a_driver_needs_is_missed_where_there_is_none(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT.replace('"skippy"', '"wants"'))
    with pytest.raises(ConfigError, match=r"wants.trim: missing"):
        load_robot(path)
    path.write_text(path.read_text() + "[wants]\ntrim = 1.0\n")
    assert load_robot(path).model_dump()["wants"] == {"trim": 1.0}
    assert load_robot("skippy").robot.driver == "skippy"


def test_the_reference_lists_it() -> None:
    (found,) = (one for one in settings_of("robot") if one.table == "skippy")
    assert (found.key, found.default, found.bounds) == ("trim", "1.0", "> 0, ≤ 2")
    lists = {one.key: (one.type, one.default) for one in settings_of("robot") if one.table == "lists"}
    assert lists["masks"] == ("list of integer", "[]")
    assert lists["limits"] == ("table of number", "{}")
    assert [one.key for one in settings_of("robot") if one.table == "lists.gains[]"] == ["ratio"]
    assert 'Of the driver "skippy"' in markdown().replace("broken", "")


def test_what_is_no_schema_is_refused() -> None:
    with pytest.raises(PluginError, match="needs a subclass"):
        plugged_use("none")


def test_packages_are_looked_for_again_only_after_an_installation(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = list[object]()

    def looking() -> object:
        looks.append(entry_points())
        return looks[-1]

    monkeypatch.setattr("config.plugins.entry_points", looking)
    place = tmp_path / "later"
    place.mkdir()
    os.utime(place, (1.0, 1.0))  # its clock may stand still for some milliseconds
    monkeypatch.syspath_prepend(str(place))
    assert all("late" not in plugged(DRIVERS) for _ in range(3))
    assert len(looks) == 1
    info = place / "late-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{DRIVERS}]\nlate = late.family\n")
    assert plugged(DRIVERS)["late"].value == "late.family"
    assert len(looks) == 2
