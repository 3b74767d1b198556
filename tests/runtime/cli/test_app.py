"""Tests of the application: help, version, exit codes, and error lines without a traceback."""

from __future__ import annotations

import signal
import subprocess
import sys
from typing import Literal

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import COMMANDS, app, main, print_error, run_command
from runtime.support.build import describe_build
from tests.runtime.cli.user_errors import error_lines


def test_an_unknown_command_is_a_wrong_call(capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(["frobnicate"]) == WRONG_CALL
    captured = capfd.readouterr()
    assert captured.out == ""
    (line,) = error_lines(captured.err)
    assert "frobnicate" in line
    assert line.endswith("See `echolocate --help`.")


def test_a_wrong_option_leads_to_the_help_of_its_command(capfd: pytest.CaptureFixture[str]) -> None:
    assert run_command(["foxglove", "--frobnicate"]) == WRONG_CALL
    (line,) = error_lines(capfd.readouterr().err)
    assert line.endswith("See `echolocate foxglove --help`.")


def test_each_problem_has_a_line_of_its_own(capfd: pytest.CaptureFixture[str]) -> None:
    sets = ["--set", "cycle.rate_hz=0", "--set", "ring.beam_half_angle_deg=wide", "--set", "nowhere.x=1"]
    assert run_command(["check", "hallway", *sets]) == WRONG_CALL
    lines = error_lines(capfd.readouterr().err)
    assert len(lines) == len({*lines}) >= 2
    assert not [line for line in lines if sum(word in line for word in ("rate_hz", "half_angle", "nowhere")) != 1]


@pytest.mark.promise("P22")
def test_an_error_has_no_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    print_error("the robot '\x1b[2J\x9b1A\u202e' is another one\nthe second line")
    first, second = capsys.readouterr().err.splitlines()
    assert first.isprintable()
    assert "\\u001b[2J" in first
    assert second == "echolocate: the second line"


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
    assert capsys.readouterr().out == f"{describe_build()}\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_completion_of_a_shell_has_every_command(shell: Literal["bash", "zsh", "fish"]) -> None:
    script = app.generate_completion(prog_name="echolocate", shell=shell)
    assert all(name in script for name in app if not name.startswith("-"))


def test_the_line_of_a_command_in_the_list_is_the_first_of_its_docstring() -> None:
    for name, line in {name: line for group in COMMANDS.values() for name, line in group.items()}.items():
        command = app[name].default_command
        assert name == "init" if command is None else (command.__doc__ or "").splitlines()[0] == line


def test_a_list_of_commands_imports_none() -> None:
    listed = "import sys, runtime.cli.app as a; a.run_command(['--help'])"
    code = f"{listed}; assert not [m for m in sys.modules if m.startswith('runtime.cli.commands.')], sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


def test_main_exits_with_the_code(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(["frobnicate"])
    assert caught.value.code == WRONG_CALL
    assert len(error_lines(capsys.readouterr().err)) == 1


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyError("planted"), FAILED, "KeyError: 'planted'"),
        (SystemExit("no such kernel"), FAILED, "no such kernel"),
        (SystemExit(), DONE, ""),
        (SystemExit(7), 7, ""),
    ],
    ids=repr,
)
def test_whatever_ends_a_command_no_library_is_taken_from_under_a_thread_that_works(
    error: BaseException, code: int, said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The interpreter's own end crashes where a kernel is compiled: `exit_process` ends each command."""

    def fail(*_arguments: object, **_options: object) -> int:
        raise error

    ended: list[int] = []
    monkeypatch.setattr("config.load.load_any", fail)
    monkeypatch.setattr("runtime.support.daemon_thread.exit_process", ended.append)
    main(["check", "hallway"])
    assert ended == [code]
    assert capsys.readouterr().err.strip().endswith(said)


def test_an_interrupt_has_its_exit_code_and_no_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*_arguments: object, **_options: object) -> int:
        raise KeyboardInterrupt

    monkeypatch.setattr("config.load.load_any", interrupt)
    with pytest.raises(SystemExit) as caught:
        main(["check", "hallway"])
    assert caught.value.code == 128 + signal.SIGINT
    assert capsys.readouterr() == ("", "")
