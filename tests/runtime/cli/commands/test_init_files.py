"""First files of one's own: good by themselves, never in the place of another, from options or from answers."""

from __future__ import annotations

import io
import math
import tomllib
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.load import load_settings
from runtime.cli.app import run_command
from runtime.cli.commands.init_files import models_for
from runtime.cycle.modes import Mode
from runtime.support.pattern_check import pattern_speed_m_s
from tests.runtime.emulated_run import Run


class Person(io.StringIO):
    """A terminal with a person's answers."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_run_files_world_is_named_as_seen_from_its_folder(capsys: pytest.CaptureFixture[str]) -> None:
    Path("sub").mkdir()
    assert run_command(["init", "world", "sub/room.toml"]) == DONE
    assert run_command(["init", "run", "sub/r.toml", "--world", "room.toml"]) == DONE, capsys.readouterr().err
    assert run_command(["check", "sub/r.toml"]) == DONE, capsys.readouterr().err


def test_defaults_keep_to_what_the_other_answers_allow() -> None:
    assert run_command(["init", "world", "small.toml", "--width", "1", "--depth", "1"]) == DONE
    assert {drum["radius_m"] for drum in tomllib.loads(Path("small.toml").read_text())["drum"]} == {0.1}


@pytest.mark.parametrize(
    "words",
    [
        ("robot", "--driver", "denning"),
        ("robot", "--driver", "denning", "--sensors", "20", "--range-max", "3"),
        ("robot", "--sensors", "1"),
        ("robot", "--layout", "in-front", "--beam-half-angle", "15", "--body-radius", "0.1"),
        ("robot", "--layout", "in-front", "--sensors", "12", "--spacing", "30"),
        ("robot", "--layout", "one-by-one", "--sensors", "5"),
        ("robot", "--driver", "arcos", "--sensors", "16"),
        ("robot", "--driver", "rflex", "--sensors", "24", "--port", "/dev/ttyUSB0"),
        ("robot", "--driver", "ros2", "--sensors", "16"),
        ("world", "--drums", "0"),
        ("world", "--surfaces", "specular"),
        ("model", "--name", "bin", "--shape", "round", "--radius", "0.2"),
        ("model", "--shape", "box", "--length", "1.2"),
        ("run", "--model", "drum, box", "--mission", "patrol"),
    ],
    ids=" ".join,
)
def test_what_is_written_is_good_and_is_never_overwritten(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    kind, *options = words
    assert run_command(["init", kind, "mine.toml", *options]) == DONE
    assert run_command(["check", "mine.toml"]) == DONE, capsys.readouterr().err
    before = Path("mine.toml").read_text()
    assert "# " in before, "it has comments"
    assert run_command(["init", kind, "mine.toml"]) == WRONG_CALL or "exists" in capsys.readouterr().err
    assert Path("mine.toml").read_text() == before
    assert run_command(["init", kind, "mine.toml", "--force"]) == DONE
    assert [path.name for path in Path().iterdir()] == ["mine.toml"], "no draft is left"


def test_the_check_that_is_proposed_finds_the_file(capsys: pytest.CaptureFixture[str]) -> None:
    """A name without a slash or .toml is that of a shipped file."""
    assert run_command(["init", "model", "mine", "--yes"]) == DONE
    words = capsys.readouterr().out.rpartition("echolocate ")[2].split()
    assert run_command(words) == DONE, capsys.readouterr().err


@pytest.mark.parametrize("driver", ["denning", "arcos", "rflex"])
def test_a_robot_that_is_described_with_the_defaults_can_be_driven(driver: str) -> None:
    """A Pioneer's own file was good for `check`, and its robot was refused for its watchdog."""
    assert run_command(["init", "robot", "mine.toml", "--driver", driver, "--name", "Rosa", "--yes"]) == DONE
    settings = load_settings("hallway", ["perception.method=paper"], robot="mine.toml")
    assert settings.robot.name == "Rosa"
    assert settings.world is not None
    run = Run(settings, settings.world, 0)
    run.until_true(lambda: run.mode is Mode.DRIVE, 4.0)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("robot", "--sensors", "0"), "--sensors 0: expected a whole number from 1 to 24"),
        (("robot", "--driver", "arcos", "--sensors", "12"), "has arrays of 8"),
        (("robot", "--range-max", "0.2"), "--range-max 0.2: expected a number from 0.25"),
        (("robot", "--sensors", "many"), "--sensors"),
        (("robot", "--layout", "behind"), "--layout"),
        (("run", "--robot", "absent.toml"), "absent.toml"),
        (("model", "--name", "a b"), "nothing was written"),
        (("model", "--length", "2", "--width", "1"), "--length, --width: no meaning beside"),
        (("model", "--shape", "box", "--radius", "1"), "another --shape"),
        (("robot", "--layout", "all-round", "--spacing", "30"), "--spacing: no meaning beside"),
        (("robot", "--driver", "ros2", "--port", "/dev/ttyUSB0"), "--port: no meaning beside"),
        (("world", "--drums", "0", "--drum-radius", "0.3"), "choose another --drums"),
    ],
)
def test_a_wrong_option_writes_nothing(words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    kind, *options = words
    assert run_command(["init", kind, "mine.toml", *options]) == WRONG_CALL
    assert said in capsys.readouterr().err
    assert list(Path().iterdir()) == []


@pytest.mark.parametrize(
    ("words", "answers"),
    [(("model", "--radius", "1"), "\nbox\n"), (("world", "--drum-radius", "0.3"), "\n\n0\n")],
)
def test_an_option_without_meaning_is_refused_before_more_is_asked(
    words: tuple[str, ...], answers: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, *options = words
    monkeypatch.setattr("sys.stdin", Person(answers))
    assert run_command(["init", kind, "mine.toml", *options]) == WRONG_CALL
    assert f"{options[0]}: no meaning" in capsys.readouterr().err


def test_what_no_option_gives_is_asked_for_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", Person("box\n9999\nlong\n1.5\n\n"))
    assert run_command(["init", "model", "table.toml", "--name", "table"]) == DONE
    asked = capsys.readouterr().err
    assert "Its shape (round, box) [round]: " in asked
    assert asked.count("expected a number from 0.02 to 20") == 2, "it asks again"
    assert "could not convert" not in asked
    written = tomllib.loads(Path("table.toml").read_text())
    assert (written["name"], written["vertices_m"][0]) == ("table", [0.75, -0.2])
    monkeypatch.setattr("sys.stdin", Person(""))
    assert run_command(["init", "model", "other.toml"]) == WRONG_CALL
    assert not Path("other.toml").exists()


@pytest.mark.parametrize("layout", ["all-round", "in-front"])
@pytest.mark.parametrize("sensors", [1, 2, 3, 5, 8, 12])
def test_any_number_of_sensors_is_written_and_what_it_cannot_do_is_said(
    layout: str, sensors: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of nine counts and five beams, all but a few ended in "the ring has no sensor there", after 13 questions."""
    words = ["--layout", layout, "--sensors", str(sensors), "--beam-half-angle", "15", "--body-radius", "0.1"]
    assert run_command(["init", "robot", "mine.toml", *words]) == DONE
    said = capsys.readouterr().out
    drives = sensors == 12 or (layout == "in-front" and sensors > 1)
    assert ("never drives ahead; of sensors with a beam of ±15° it needs 2 in front" in said) == (not drives)
    assert ("no sensor looks from" in said) == (not (layout == "all-round" and drives))
    assert (pattern_speed_m_s(load_settings("room", robot="mine.toml")) > 0.0) == drives


def test_a_person_sees_what_an_answer_costs_and_keeps_the_answers_when_one_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Driver, body, beam, layout, sensors, distance, spacing, ranges …; the second round mends the line's speed."""
    first = ["", "0.1", "15", "in-front", "3", "0.09", "", "0.02", "4", "0.003", "0.4", "2", "no", "300", ""]
    second = [""] * 13 + ["115200", ""]
    monkeypatch.setattr("sys.stdin", Person("\n".join([*first, *second, ""])))
    assert run_command(["init", "robot", "mine.toml", "--name", "Rosa"]) == DONE
    asked = capsys.readouterr().err
    assert "every direction within 23° of its way: of sensors with a beam of ±15° it needs 2 in front" in asked
    assert "never drives backwards" in asked
    assert "a board of one's own, Pico or ESP32" in asked
    assert "a line of 300 baud" in asked
    assert "Once more: Enter keeps an answer." in asked
    assert "Number of sensors [3]: " in asked
    ring = load_settings("room", robot="mine.toml").ring
    assert [round(math.degrees(mount.angle_rad)) for mount in ring.mounts] == [25, 0, -25]


@pytest.mark.parametrize(
    ("radius_m", "model", "note"),
    [(None, "drum", "has no drums"), (0.15, "drum", "have the radius 0.15 m"), (0.3048, "semicircle", "")],
)
def test_the_default_model_of_a_run_is_what_its_world_has(radius_m: float | None, model: str, note: str) -> None:
    drum = "" if radius_m is None else f"[[drum]]\nx_m = 1.0\ny_m = 0.0\nradius_m = {radius_m}\n"
    Path("world.toml").write_text(f"[[wall]]\nx1_m = 0.0\ny1_m = 3.0\nx2_m = 4.0\ny2_m = 3.0\n{drum}")
    found, said = models_for("world.toml")
    assert found == model
    assert note in said
    assert (said == "") == (note == "")
