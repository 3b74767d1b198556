"""`echolocate firmware`: what it writes, what it keeps, what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import load_robot
from runtime.cli.app import run_command


def call(folder: Path, *more: str, board: str = "pico") -> int:
    return run_command(["firmware", "--board", board, "--out", str(folder), *more])


@pytest.mark.parametrize("board", ["pico", "esp32"])
def test_the_files_and_a_robot_file_that_drives(
    board: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(tmp_path / "a", board=board) == DONE
    said = capsys.readouterr().out
    assert "mpremote fs cp -r" in said
    robot = load_robot(str(tmp_path / "a" / "robot.toml"))
    assert len(robot.ring.mounts) == 12
    assert (tmp_path / "a" / "ring" / "robot.py").exists()
    assert run_command(["check", str(tmp_path / "a" / "robot.toml")]) == DONE


def test_the_users_pins_are_kept_and_the_robot_file_follows_them(tmp_path: Path) -> None:
    assert call(tmp_path) == DONE
    config = tmp_path / "robot_config.py"
    mine = config.read_text("utf-8").replace("RING_RADIUS_MM = 90", "RING_RADIUS_MM = 120")
    config.write_text(mine, "utf-8")
    assert call(tmp_path, "--force") == DONE
    assert config.read_text("utf-8") == mine
    assert load_robot(str(tmp_path / "robot.toml")).ring.radius_m == 0.12


def test_a_robot_file_of_another_robot_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "robot.toml").write_text("# my Pioneer\n")
    assert run_command(["firmware", "--board", "esp32", "--out", str(tmp_path)]) == WRONG_CALL
    assert "robot.toml" in capsys.readouterr().err
    assert (tmp_path / "robot.toml").read_text() == "# my Pioneer\n"


def test_changes_of_the_firmware_are_overwritten_with_force_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(tmp_path) == DONE
    main = tmp_path / "main.py"
    original = main.read_text("utf-8")
    main.write_text("mine", "utf-8")
    assert call(tmp_path) == WRONG_CALL
    assert "main.py differ" in capsys.readouterr().err
    assert main.read_text("utf-8") == "mine"
    assert call(tmp_path, "--force") == DONE
    assert main.read_text("utf-8") == original


@pytest.mark.parametrize(
    ("old", "new", "board", "said"),
    [
        ("STEP_PERIOD_S = 0.05", "STEP_PERIOD_S = 0.01", "pico", "step_period_s 0.01 is shorter"),
        ("STEP_PERIOD_S = 0.05", "import os", "pico", "only NAME = value"),
        ('("hc-sr04", 0, 5)', '("hc-sr04", 0, 4)', "pico", "sensors 0 and 3 share echo pin 4"),
        ('ECHO_TIMING = "pio"', 'ECHO_TIMING = "pio"', "esp32", "on this board it is"),
        ('("hc-sr04", 0, 4)', "pin(4)", "pico", "a value is no constant"),
    ],
)
def test_pins_that_cannot_work_are_refused(
    old: str, new: str, board: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(tmp_path) == DONE
    config = tmp_path / "robot_config.py"
    text = config.read_text("utf-8")
    assert old in text
    config.write_text(text.replace(old, new), "utf-8")
    assert call(tmp_path, board=board) == WRONG_CALL
    assert said in capsys.readouterr().err


def test_a_folder_that_cannot_be_made_or_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("x", "utf-8")
    assert call(tmp_path / "file") == FAILED
    assert "choose another folder" in capsys.readouterr().err
    (tmp_path / "robot_config.py").write_bytes(b"\xff")
    assert call(tmp_path) == WRONG_CALL
    assert "UTF-8" in capsys.readouterr().err
