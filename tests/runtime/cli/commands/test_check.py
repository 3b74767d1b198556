"""Tests of `echolocate check`: every shipped file is good, and a warning does not make a file wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.load import list_shipped
from runtime.cli.app import run_command

ROOT = Path(__file__).parents[4]
WITH_BLIND_SIDES = {"amigo", "hobby3", "hobby8", "p3at", "p3dx-sh", "p3dx", "peoplebot"}
"""Robots whose sensors leave gaps."""
FAST_FIRING = {"servo1"}
"""Robots that fire several times in a cycle."""
SHIPPED = sorted(path for path in (ROOT / "config").rglob("*.toml"))


@pytest.mark.parametrize("path", SHIPPED, ids=[f"{path.parent.name}/{path.name}" for path in SHIPPED])
def test_every_shipped_file_is_good(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", str(path)]) == DONE
    said = capsys.readouterr()
    *notes, good = said.out.splitlines()
    assert (good, said.err) == (f"{path}: good", "")
    if path.parent.name in {"robots", "runs"}:
        assert notes.pop().startswith(f"{path}: kill -9 leaves it moving for at most ")
    assert bool(notes) == (path.stem in WITH_BLIND_SIDES | FAST_FIRING)
    about = "cycle" if path.stem in FAST_FIRING else "ring: "
    assert all(note.startswith(f"{path}: {about}") for note in notes)


def test_every_shipped_run_is_good_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for name in list_shipped("runs"):
        assert run_command(["check", name]) == DONE
        killed, good = capsys.readouterr().out.splitlines()
        assert killed.startswith(f"{name}: kill -9 ")
        assert good == f"{name}: good"


@pytest.mark.parametrize("name", ["denning", "drum", "office"])
def test_a_robot_a_model_and_a_world_are_good_by_name(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", name]) == DONE
    assert capsys.readouterr().out.endswith(f"{name}: good\n")


def test_an_unwise_setting_is_named_and_good(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hallway", "--set", "cycle.rate_hz=5"]) == DONE
    warning, _, good = capsys.readouterr().out.splitlines()
    assert warning.startswith("hallway: cycle.rate_hz = 5")
    assert good == "hallway: good"


@pytest.mark.promise("P24")
def test_a_pattern_with_which_the_robot_could_not_drive_is_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    for firing in ("{preset='single', step_period_s=0.1}", "{sets=[[10, 12, 14]]}"):
        assert run_command(["check", "hallway", "--set", f"ring.firing={firing}"]) == WRONG_CALL
        out, err = capsys.readouterr()
        assert out == ""
        assert "so that the robot could not drive" in err
    assert run_command(["check", "hallway", "--set", "ring.firing=single"]) == DONE
    assert "limits the speed to 0.10 m/s" in capsys.readouterr().out


def test_a_line_too_slow_or_ranges_finer_than_it_are_wrong(capsys: pytest.CaptureFixture[str]) -> None:
    """The line's load was blamed on the cable, and the resolution ignored."""
    for sets, said in (
        (["link.baud=9600"], "a line of 9600 baud carries 960"),
        (["robot.protocol=1", "ring.resolution_m=0.001"], "ring.resolution_m = 0.001 is finer than the 0.03048 m"),
        (['robot="p3dx"', "ring.resolution_m=0.0001"], "ring.resolution_m = 0.0001 is finer than the 0.001 m"),
        (['robot="b21r"', "ring.resolution_m=0.0001"], "ring.resolution_m = 0.0001 is finer than the 0.0006775 m"),
    ):
        words = [word for one in sets for word in ("--set", one)]
        assert run_command(["check", "hallway", *words]) == WRONG_CALL
        out, err = capsys.readouterr()
        assert out == ""
        assert said in err


def test_what_only_all_values_together_make_wrong_is_said_of_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """ "25 sensors do not divide by 8" named none."""
    robot, run = tmp_path / "mine.toml", tmp_path / "run.toml"
    robot.write_text((ROOT / "config/robots/denning.toml").read_text().replace("count = 24", "count = 25"))
    run.write_text('robot = "mine.toml"\n')
    for words in (["check", str(robot)], ["check", str(run)], ["run", "--headless", "--robot", str(robot)]):
        assert run_command(words) == WRONG_CALL
        assert capsys.readouterr().err.startswith(f"echolocate: {words[-1]}: ring.firing: preset ")


@pytest.mark.parametrize("words", [("check", "denning"), ("run", "--headless", "--robot", "denning")])
def test_a_good_file_is_not_blamed_for_what_is_set_over_it(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:  # fmt: skip
    assert run_command([*words, "--set", "ring.count=25"]) == WRONG_CALL
    assert capsys.readouterr().err.startswith("echolocate: --set over denning: ring.firing: preset ")


@pytest.mark.parametrize("name", ["drive.csv", "runs/drive.mcap"])
def test_data_of_a_run_are_no_configuration(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """A ring log was "no such run", and by its path an invalid key in line 1."""
    assert run_command(["check", name]) == WRONG_CALL
    assert f"`echolocate replay {name}` reads it" in capsys.readouterr().err
