"""The settings of a run: whole, refused, and the same way again when the files are read again."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from config.errors import DONE, UserError
from config.load import ConfigError, load_settings
from config.settings import GoalConfig
from runtime.cli.app import run_command
from runtime.cli.commands.run.run_settings import SettingsFiles, with_port
from runtime.support.config_lint import lint_settings

BACKWARDS = "ring.firing={sets=[[10, 12, 14]]}"


@pytest.mark.promise("P24")
def test_a_pattern_with_which_it_could_not_drive_is_refused_in_a_reload_too() -> None:
    with pytest.raises(UserError, match="the pattern does not look ahead"):
        SettingsFiles(sets=(BACKWARDS,)).read()
    with pytest.raises(ConfigError, match="the pattern does not look ahead"):
        SettingsFiles(sets=(BACKWARDS,)).read_again(None, None)
    with pytest.raises(ConfigError, match="p3xd"):
        SettingsFiles(robot="p3xd").read_again(None, None)


def test_a_reload_keeps_robot_room_and_port_of_the_command_line() -> None:
    settings = SettingsFiles(robot="p3dx").read_again("socket://localhost:8101", None)
    assert (settings.robot.driver, settings.link.port) == ("arcos", "socket://localhost:8101")
    assert settings == SettingsFiles(sets=("link.port=socket://localhost:8101",), robot="p3dx").read()
    emulated = SettingsFiles(map_file="hallway", no_console=True).read_again(None, "/dev/pts/7")
    assert emulated.link.port == "/dev/pts/7"
    assert emulated.perception.localization.known_room
    assert not emulated.console.enabled


def test_a_port_that_no_settings_can_hold_is_refused() -> None:
    with pytest.raises(UserError, match="its path is not UTF-8"):
        with_port(load_settings(), os.fsdecode(b"/dev/\xff"))


def test_a_goal_of_the_command_line_takes_the_place_of_the_files_goal_or_mission() -> None:
    def goal_of(text: str, run: str | None = None, map_file: str | None = None) -> GoalConfig | None:
        settings = SettingsFiles(run, map_file=map_file, goal=text).read()
        assert settings.mission is None
        return settings.goal

    assert goal_of("-1,2.5") == GoalConfig(x_m=-1.0, y_m=2.5)
    assert goal_of("1,2,-90", map_file="room") == GoalConfig(x_m=1.0, y_m=2.0, heading_deg=-90.0, frame="map")
    for wrong in ("1", "1,2,3,4", "a,b", "1,2,400", "nan,1", "1,2,", "1e9,0"):
        with pytest.raises(UserError, match="expected X,Y in metres"):
            goal_of(wrong)
    with pytest.raises(UserError, match="exclude each other"):
        SettingsFiles(mission="patrol", goal="1,2").read()
    assert SettingsFiles(goal="1,2").read_again(None, None).goal == GoalConfig(x_m=1.0, y_m=2.0)


def test_a_shipped_world_is_driven_as_the_run_of_its_name_says_unless_a_run_is_named() -> None:
    office = SettingsFiles(world="office").read()
    assert office.goal is not None
    assert office.perception.grid.method == "directed"
    assert SettingsFiles("hallway", world="office").read().goal is None


def test_a_robot_without_a_body_is_good_for_replays_and_no_run(tmp_path: Path) -> None:
    file = tmp_path / "ring.toml"
    file.write_text("[ring]\nbeam_half_angle_deg = 15\nresolution_m = 0.0\nrange_min_m = 0.02\nrange_max_m = 4.0\n"
                    "sensors = [{x_m = 0.0, y_m = 0.0, angle_deg = 0}]\nfiring = 'single'\n")  # fmt: skip
    assert lint_settings(load_settings("room", robot=str(file))) == [
        "body: none is described: the file is good for replays, stands and maps; to drive, add a [body]"
    ]
    assert run_command(["check", str(file)]) == DONE
    with pytest.raises(UserError, match=r"add a \[body\] with radius_m"):
        SettingsFiles(robot=str(file)).read()
