"""Places in map files, in run files and in missions."""

from pathlib import Path

import pytest

from config.errors import UserError
from config.load import ConfigError, load_settings, load_world, parse_text, with_known_room, with_mission
from config.mission import MissionConfig
from config.places import PlacesConfig
from runtime.cli.commands.check import check
from runtime.cli.commands.run.run_settings import SettingsFiles

MAP = """
[[wall]]
x1_m = -4.0
y1_m = 3.0
x2_m = 4.0
y2_m = 3.0
[[place]]
name = "charger"
x_m = 1.0
y_m = 2.0
heading_deg = 90.0
[[place]]
name = "gate"
x_m = -1.0
y_m = 2.0
[[no_go_line]]
name = "stairs"
points_m = [[0.0, 0.0], [1.0, 0.0]]
[[no_go_area]]
vertices_m = [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]
[[speed_area]]
vertices_m = [[5.0, 5.0], [6.0, 5.0], [6.0, 6.0]]
speed_max_m_s = 0.1
"""


def mission(place: str) -> MissionConfig:
    """Return a mission that drives to a place."""
    text = f'name = "home"\n[[step]]\nname = "go"\nschemas = [{{ name = "move_to_goal", place = "{place}" }}]\n'
    return parse_text(MissionConfig, text, "mission")


def test_a_map_brings_its_places(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(MAP, encoding="utf-8")
    settings = with_known_room(load_settings("room"), tmp_path / "map.toml")
    assert settings.places == load_world(tmp_path / "map.toml").places()
    assert str(settings.places) == "2 places, 1 no-go lines, 1 no-go areas, 1 speed areas"
    assert settings.places_frame == "map"
    assert settings.perception.localization.known_room is not None
    assert not settings.perception.localization.known_room.has_any


def test_a_map_without_places_keeps_those_of_the_run(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(MAP.partition("[[place]]")[0], encoding="utf-8")
    given = load_settings("room").model_copy(update={"places": parse_text(PlacesConfig, places_text(), "places")})
    assert with_known_room(given, tmp_path / "map.toml").places == given.places


def places_text() -> str:
    """Return the part of the map file that holds the places."""
    return "[[place]]" + MAP.partition("[[place]]")[2]


def test_an_unknown_place_is_refused_with_those_that_there_are() -> None:
    settings = load_settings("room").model_copy(update={"places": parse_text(PlacesConfig, places_text(), "places")})
    assert with_mission(settings, mission("charger")).mission is not None
    with pytest.raises(ConfigError, match=r"no place is named charge; did you mean charger\?.*charger, gate"):
        with_mission(settings, mission("charge"))
    with pytest.raises(ConfigError, match="no place has been named yet"):
        with_mission(load_settings("room"), mission("charger"))


def test_a_run_drives_to_a_place_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(MAP, encoding="utf-8")

    def goal(text: str) -> object:
        map_file = str(tmp_path / "map.toml")
        return SettingsFiles("room", map_file=map_file, goal=text).read().goal

    found = goal("charger")
    assert found is not None
    assert (found.x_m, found.y_m, found.heading_deg, found.frame) == (1.0, 2.0, 90.0, "map")  # type: ignore[attr-defined]
    with pytest.raises(UserError, match=r"no place is named gat; did you mean gate\?"):
        goal("gat")


def test_check_names_an_unknown_place(tmp_path: Path) -> None:
    steps = '[[step]]\nname = "go"\nschemas = [{ name = "move_to_goal", place = "charger" }]\n'
    (tmp_path / "errand.toml").write_text(f'name = "errand"\n{steps}', encoding="utf-8")
    (tmp_path / "run.toml").write_text('robot = "denning"\nmission = "./errand.toml"\n', encoding="utf-8")
    assert check(str(tmp_path / "errand.toml")) == 0, "its map is not known yet"
    with pytest.raises(ConfigError, match="mission errand: no place is named charger"):
        check(str(tmp_path / "run.toml"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ('[[place]]\nname = "a"\nx_m = 0.0\ny_m = 0.0\n' * 2, "two places are named a"),
        ('[[place]]\nname = "A dock"\nx_m = 0.0\ny_m = 0.0\n', "name"),
        ("[[no_go_area]]\nvertices_m = [[0.0, 0.0], [1.0, 0.0]]\n", "vertices_m"),
        ("[[speed_area]]\nvertices_m = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]\n", "speed_max_m_s"),
    ],
)
def test_what_is_wrong_is_said(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        parse_text(PlacesConfig, text, "places")
