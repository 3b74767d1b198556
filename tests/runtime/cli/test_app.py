"""Everything a user can get wrong at the command line: the right exit code, one clear line, never a traceback."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import list_shipped
from runtime.cli.app import main, run_command

ROOT = Path(__file__).parents[3]
HEADER = "t,x,y,theta," + ",".join(f"r{i:02d}" for i in range(24))
ROW = ",".join(["1"] * 24)
LOG_LINE = re.compile(r"^\S+Z \[(info|warning) *\] ")
"""Log output of a headless run before its error message."""


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files that are wrong, by names that are short."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "regular").touch()
    (tmp_path / "broken.toml").write_text("[[drum]]\nx_m = 1.0\ny_m = = 2.0\n")
    (tmp_path / "drum.toml").write_text("[[drum]]\nx_m = 1.0\ny_m = 'two'\nradius_m = 0.3\n")
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "fault.toml").write_text("[[fault]]\nat_s = 1.0\nkind = 'earthquake'\n")
    (tmp_path / "fault_broken.toml").write_text("[[fault]\n")
    (tmp_path / "latin.toml").write_bytes(b"name = '\xe9'\n")
    (tmp_path / "good.csv").write_text(f"{HEADER}\n0,0,0,0,{ROW}\n")
    (tmp_path / "column.csv").write_text(f"{HEADER}\n".replace("y,", "") + f"0,0,0,{ROW}\n")
    rows = [f"{k},0,0,0,{ROW}" for k in range(9)]
    rows[5] = rows[5].replace(",1", ",one", 1)
    (tmp_path / "seven.csv").write_text("\n".join([HEADER, *rows]) + "\n")
    (tmp_path / "sixteen.csv").write_text(
        "t,x,y,theta," + ",".join(f"r{i:02d}" for i in range(16)) + "\n0,0,0,0," + ",".join(["1"] * 16) + "\n"
    )
    (tmp_path / "binary.csv").write_bytes(bytes(range(256)))


def errors(captured: str) -> list[str]:
    """Return the error messages on stderr: all lines that are not log lines."""
    assert "Traceback" not in captured
    lines = [line for line in captured.splitlines() if not LOG_LINE.match(line)]
    for line in lines:
        assert line.startswith("echolocate: "), line
        assert line.isprintable()
    return lines


WRONG: list[tuple[list[str], str]] = [
    (["frobnicate"], "frobnicate"),
    (["run", "--frobnicate"], "--frobnicate"),
    (["run", "hallway", "irregular"], "irregular"),
    (["run", "--port"], "--port"),
    (["run", "--port", "nowhere"], "nowhere"),
    (["run", "--port", "/dev/nowhere", "--headless"], "/dev/nowhere"),
    (["run", "--port", "regular", "--headless"], "regular"),
    (["run", "--port", "."], "."),
    (["run", "--port", ""], "port"),
    (["run", "--seconds", "0"], "--seconds 0"),
    (["run", "--seconds", "-1"], "--seconds"),
    (["run", "--seconds", "nan"], "--seconds nan"),
    (["run", "--seconds", "soon"], "soon"),
    (["run", "--seed", "x"], "--seed"),
    (["run", "--units", "yards"], "yards"),
    (["run", "--set"], "--set"),
    (["run", "--set", "ring"], "ring"),
    (["run", "--set", "ring.firing=octants"], "octants"),
    (["run", "--set", "cycle.rate_hz=0"], "cycle.rate_hz"),
    (["run", "--set", "cycle.rate=20"], "cycle.rate"),
    (["run", "--set", "ring.firing.step_period_s=0.001"], "step_period_s"),
    (["run", "--set", "log.file='regular/run.jsonl'", "--headless"], "regular/run.jsonl"),
    (["run", "halway"], "halway"),
    (["run", "./halway.toml"], "halway.toml"),
    (["run", "broken.toml"], "broken.toml: line 3"),
    (["run", "--world", "halway"], "halway"),
    (["run", "--world", "./nowhere.toml"], "nowhere.toml"),
    (["run", "--world", "broken.toml"], "broken.toml: line 3"),
    (["run", "--world", "drum.toml"], "drum.0.y_m"),
    (["run", "--world", "latin.toml"], "latin.toml"),
    (["run", "--world", "."], "."),
    (["run", "--headless", "--seconds", "1", "--faults", "fault_broken.toml"], "fault_broken.toml: line 1"),
    (["emulate", "--faults", "fault.toml"], "earthquake"),
    (["emulate", "--faults", "fault_broken.toml"], "fault_broken.toml: line 1"),
    (["emulate", "--faults", "nowhere.toml"], "nowhere.toml"),
    (["emulate", "--world", "halway"], "halway"),
    (["emulate", "--robot", "dening"], "dening"),
    (["emulate", "--config", "halway"], "halway"),
    (["emulate", "--seed", "1.5"], "1.5"),
    (["emulate", "--seed", "-1"], "-1"),
    (["run", "--headless", "--seed", "-1"], "-1"),
    (["experiment", "hallway", "--seeds", "1.5"], "1.5"),
    (["experiment"], "NAME"),
    (["experiment", "corridor"], "corridor"),
    (["experiment", "hallway", "--method", "psychic"], "psychic"),
    (["experiment", "hallway", "--seeds", "0"], "--seeds 0"),
    (["experiment", "hallway", "--seeds", "many"], "many"),
    (["experiment", "hallway", "--world", "empty.toml"], "drum"),
    (["experiment", "hallway", "--json"], "--json"),
    (["replay"], "LOG"),
    (["replay", "nowhere.csv"], "nowhere.csv"),
    (["replay", "."], "."),
    (["replay", "column.csv"], "'y'"),
    (["replay", "seven.csv"], "row 7 column 'r00' is 'one'"),
    (["replay", "sixteen.csv"], "16 sensor columns"),
    (["replay", "binary.csv"], "binary.csv"),
    (["replay", "regular"], "regular: is empty"),
    (["replay", "good.csv", "--model", "cat"], "cat"),
    (["replay", "good.csv", "--robot", "dening"], "dening"),
    (["check"], "CONFIG"),
    (["check", "halway"], "halway"),
    (["check", "broken.toml"], "broken.toml: line 3"),
    (["check", "nowhere.toml"], "nowhere.toml"),
    (["check", "drum.toml"], "y_m"),
]


@pytest.mark.parametrize(("arguments", "cause"), WRONG, ids=[" ".join(row[0]) for row in WRONG])
def test_a_wrong_call(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(arguments) == WRONG_CALL
    captured = capfd.readouterr()
    assert captured.out == ""
    (line,) = errors(captured.err)
    assert cause in line


def test_each_problem_has_a_line_of_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    sets = ["--set", "cycle.rate_hz=0", "--set", "ring.beam_half_angle_deg=wide", "--set", "nowhere.x=1"]
    assert run_command(["check", "hallway", *sets]) == WRONG_CALL
    lines = errors(capfd.readouterr().err)
    assert len(lines) == len({*lines}) >= 2
    assert not [line for line in lines if sum(word in line for word in ("rate_hz", "half_angle", "nowhere")) != 1]


FAILING: list[tuple[list[str], str]] = [
    (["experiment", "hallway", "--json", "nowhere/x.json"], "nowhere/x.json"),
    (["replay", "good.csv", "--json", "nowhere/x.json"], "nowhere/x.json"),
    (["run", "--headless", "--json", "nowhere/x.json"], "nowhere/x.json"),
    (["run", "--headless", "--record", "nowhere/x.csv"], "nowhere/x.csv"),
    (["run", "--headless", "--record", "regular/x.csv"], "regular/x.csv"),
    (["emulate", "--link", "regular"], "regular"),
    (["emulate", "--link", "nowhere/robot"], "nowhere/robot"),
    (["emulate", "--trace", "nowhere/x.csv"], "nowhere/x.csv"),
]


@pytest.mark.parametrize(("arguments", "cause"), FAILING, ids=[" ".join(row[0]) for row in FAILING])
def test_work_that_failed(arguments: list[str], cause: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(arguments) == FAILED
    (line,) = errors(capfd.readouterr().err)
    assert cause in line
    assert Path("regular").read_bytes() == b""


@pytest.mark.parametrize("arguments", [["--help"], ["-h"], [], ["run", "--help"], ["experiment", "--help"]])
def test_help(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(arguments) == DONE
    captured = capsys.readouterr()
    assert "Usage: echolocate" in captured.out
    assert captured.err == ""


def test_help_describes_every_option_of_the_public_surface(capsys: pytest.CaptureFixture[str]) -> None:
    surface = {
        "run": ["--port", "--arm", "--seconds", "--headless", "--record", "--json", "--set"],
        "emulate": ["--world", "--link", "--faults", "--seed"],
        "replay": ["LOG", "--robot", "--model", "--json", "--units"],
        "experiment": ["hallway", "--method", "--world", "--seeds", "--json", "--units"],
        "check": ["CONFIG"],
    }
    for command, words in surface.items():
        assert run_command([command, "--help"]) == DONE
        text = capsys.readouterr().out
        for word in words:
            assert word in text, (command, word)


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["--version"]) == DONE
    assert re.fullmatch(r"\d+\.\d+\.\d+\n", capsys.readouterr().out)


SHIPPED = sorted(path for path in (ROOT / "config").rglob("*.toml"))


@pytest.mark.parametrize("path", SHIPPED, ids=[f"{path.parent.name}/{path.name}" for path in SHIPPED])
def test_every_shipped_file_is_good(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", str(path)]) == DONE
    assert capsys.readouterr() == (f"{path}: good\n", "")


def test_every_shipped_run_is_good_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for name in list_shipped("runs"):
        assert run_command(["check", name]) == DONE
        assert capsys.readouterr().out == f"{name}: good\n"


def test_a_replay_of_one_firing(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["replay", "good.csv", "--model", "drum", "--model", "box", "--json", "x.json"]) == DONE
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "1 firings, 0 outline segments, 0 clusters" in captured.out
    assert Path("x.json").stat().st_size > 0


def test_main_exits_with_the_code(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["frobnicate"])
    assert caught.value.code == WRONG_CALL
    assert len(errors(capsys.readouterr().err)) == 1


def test_as_a_program_too() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "runtime.cli", "check", "halway"],
        env={**os.environ, "PYTHONPATH": str(ROOT)}, text=True, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == WRONG_CALL
    assert done.stdout == ""
    assert len(errors(done.stderr)) == 1


def test_a_reader_that_leaves_is_no_traceback() -> None:
    """As in `echolocate experiment hallway | head -1`."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as out:
        done = subprocess.run(
            [sys.executable, "-m", "runtime.cli", "check", "hallway"],
            env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=out, stderr=subprocess.PIPE, text=True, timeout=60,
            check=False,
        )  # fmt: skip
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
