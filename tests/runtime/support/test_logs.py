"""Tests of the log: JSON lines in a file, readable lines on the terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import pytest

from config.errors import WRONG_CALL, UserError
from config.settings import LogConfig
from runtime.support.logs import open_log


def lines(path: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def test_each_line_of_the_file_is_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "logs" / "run.jsonl"
    with open_log(LogConfig(file=str(path)), terminal=True) as log:
        log.info("mode", mode="DRIVE", reason='two\nlines and "quotes"', cycle=3)
        log.warning("odd", path=Path("a/b"), number=float("nan"))
    first, second = lines(path)
    assert first.pop("timestamp")
    assert first == {
        "event": "mode", "level": "info", "mode": "DRIVE", "reason": "two\nlines and \"quotes\"", "cycle": 3,
    }  # fmt: skip
    assert (second["event"], second["level"], second["path"], second["number"]) == ("odd", "warning", "a/b", None)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert [line.partition("Z ")[2] for line in shown.err.splitlines()] == [
        r'[info   ] Mode DRIVE: "two\nlines and \"quotes\"" (cycle 3)', "[warning] Odd (path a/b, number nan)"
    ]  # fmt: skip
    assert "\x1b" not in shown.err, "no colours without a terminal"


def test_lines_below_the_level_are_dropped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.jsonl"
    with open_log(LogConfig(file=str(path), level="warning"), terminal=True) as log:
        log.debug("a")
        log.info("b")
        log.warning("c")
        log.error("d")
        log.info("console", start_url="http://localhost:1/?token=x")
    found = lines(path)
    assert [line["event"] for line in found] == ["c", "d", "console"]
    assert found[2]["start_url"] == "http://localhost:1/?token=x", "at every level: no other way leads to the console"
    assert len(capsys.readouterr().err.splitlines()) == 3


def test_no_line_is_printed_over_a_live_view(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "run.jsonl"
    with open_log(LogConfig(file=str(path)), terminal=False) as log:
        log.error("quiet")
    assert capsys.readouterr() == ("", "")
    assert len(lines(path)) == 1


def test_a_log_is_appended_to(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    for k in range(2):
        with open_log(LogConfig(file=str(path)), terminal=False) as log:
            log.info(f"run {k}")
    assert [line["event"] for line in lines(path)] == ["run 0", "run 1"]


def test_an_exception_stays_one_line(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl"
    with open_log(LogConfig(file=str(path)), terminal=False) as log:
        try:
            Path("the cause").read_text("utf-8")
        except FileNotFoundError:
            log.exception("the cycle failed")
    (line,) = lines(path)
    assert line["level"] == "error"
    assert "FileNotFoundError: " in str(line["exception"])


@pytest.mark.parametrize("name", ["", "file/run.jsonl"])
def test_an_unwritable_file_is_a_wrong_configuration(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / name
    with (
        ExitStack() as stack,
        pytest.raises(UserError, match=r"^log\.file = .* cannot be written: .*; choose another file$") as caught,
    ):
        stack.enter_context(open_log(LogConfig(file=str(path)), terminal=False))
    assert caught.value.exit_code == WRONG_CALL
    assert str(path) in str(caught.value)


def test_by_default_the_log_is_in_the_state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with open_log(LogConfig(), terminal=False) as log:
        log.info("kept")
    assert [line["event"] for line in lines(tmp_path / "state" / "echolocate" / "echolocate.jsonl")] == ["kept"]


def test_an_unwritable_state_folder_is_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "state").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with open_log(LogConfig(), terminal=True) as log:
        log.info("still here")
    warning, line = capsys.readouterr().err.splitlines()
    assert "No log file is written" in warning
    assert str(tmp_path / "state") in warning
    assert "Still here" in line


@pytest.mark.promise("P22")
def test_a_flood_of_lines_is_limited_and_suppresses_no_other_level(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    path, host_s = tmp_path / "run.jsonl", 0.0
    with open_log(LogConfig(file=str(path)), terminal=False, clock=lambda: host_s) as log:
        for k in range(10_000):
            host_s = 1e-3 * k
            log.warning(f"sensor {k % 24} is masked")
            if k % 2_000 == 1_999:
                log.error("the cycle failed")
                log.info("mode")
        host_s = 60.0
        log.warning("the last one")
        for _ in range(1_000):
            log.info("flood")
    events = lines(path)
    warnings = [event for event in events if event.get("level") == "warning"]
    assert 300 <= len(warnings) <= 400
    assert sum(1 + int(str(event.get("left_out_before", 0))) for event in warnings) - 1 == 10_000
    assert warnings[-1]["event"] == "the last one"
    assert sum(event.get("level") == "error" for event in events) == 5
    assert events[-1] == {"event": "log lines were left out at the end", "left_out": 700}
    measured(f"10,000 warnings in 10 s: {len(warnings) - 1} lines, none of 5 errors suppressed")


def test_a_file_that_is_no_log_is_refused(tmp_path: Path) -> None:
    (tmp_path / "my.toml").write_text("robot = 'denning'\n")
    with ExitStack() as stack, pytest.raises(UserError, match="it is not a log; choose another file"):
        stack.enter_context(open_log(LogConfig(file=str(tmp_path / "my.toml")), terminal=False))
    assert (tmp_path / "my.toml").read_text() == "robot = 'denning'\n"


@pytest.mark.promise("P22")
@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_secret_goes_to_the_file_and_to_a_terminal_only(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *, is_terminal: bool
) -> None:
    """Elsewhere, as in the journal of a service, the line says where it is."""
    path = tmp_path / "run.jsonl"
    monkeypatch.setattr(sys.stderr, "isatty", lambda: is_terminal)
    heard: list[Mapping[str, object]] = []
    with open_log(LogConfig(file=str(path)), terminal=True, listener=heard.append) as log:
        log.info("console", url="http://robot", start_url="http://robot?token=s3cr3t")
    assert ("s3cr3t" in capsys.readouterr().err) == is_terminal
    assert lines(path)[0]["start_url"] == "http://robot?token=s3cr3t"
    assert "s3cr3t" not in str(heard)
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("name", "value", "coloured"), [("TERM", "xterm", True), ("TERM", "dumb", False), ("NO_COLOR", "1", False)]
)
def test_lines_are_coloured_where_the_terminal_takes_colours(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str, value: str,
    *, coloured: bool,
) -> None:  # fmt: skip
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with open_log(LogConfig(file=str(tmp_path / "run.jsonl")), terminal=True) as log:
        log.info("start")
    assert ("\x1b[" in capsys.readouterr().err) == coloured


@pytest.mark.promise("P22")
def test_no_control_character_reaches_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither of a robot's name nor of an operator's text; the file has them in full, as JSON."""
    path, hostile = tmp_path / "run.jsonl", "\x1b[2J\x9b1A\r\u202e\nFAULT"
    with open_log(LogConfig(file=str(path)), terminal=True) as log:
        log.info("robot ready", robot=hostile, known=[hostile])
        log.warning(f"the robot {hostile} is another one")
        log.error("the cycle failed", exc_info=ValueError(hostile))
    shown = capsys.readouterr().err
    assert all(line.isprintable() for line in shown.splitlines())
    assert "\\u001b[2J" in shown
    assert lines(path)[0]["robot"] == hostile


@pytest.mark.promise("P28")
def test_without_a_home_folder_the_log_goes_to_a_temporary_one_and_says_so(
    homeless: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with open_log(LogConfig(), terminal=True) as log:
        log.info("start")
    (file,) = homeless.glob("tmp/*/echolocate.jsonl")
    assert [line["event"] for line in lines(file)][1:] == ["start"]
    err = capsys.readouterr().err
    assert "No home folder is known" in err
    assert str(file.parent) in err


@pytest.mark.promise("P28")
def test_a_text_that_is_not_utf8_is_written_escaped(tmp_path: Path) -> None:
    with open_log(LogConfig(file=str(tmp_path / "log")), terminal=False) as log:
        log.info("recording", file="\udcff.mcap")
    assert lines(tmp_path / "log")[0]["file"] == r"\udcff.mcap"
