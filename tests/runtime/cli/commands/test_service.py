"""`echolocate service`: the unit that is printed is valid, and quotes what systemd would interpret."""

from __future__ import annotations

import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from runtime.cli.app import run_command
from runtime.cli.commands.service import quote_for_systemd
from runtime.cli.first_signals import EXIT_CODE_BASE


def test_the_unit_that_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sets = ["--set", "behaviors.arbiter.base_velocity_m_s=0.2"]
    assert run_command(["service", "hallway", "--port", "/dev/ttyUSB0", *sets]) == DONE
    printed = capsys.readouterr()
    assert printed.err == ""
    lines = printed.out.splitlines()
    (start,) = [line for line in lines if line.startswith("ExecStart=")]
    shared = "run hallway --port /dev/ttyUSB0 --headless --set console.keep_token=true"
    assert f"{shared} --set behaviors.arbiter.base_velocity_m_s=0.2" in start
    assert "--arm" not in printed.out
    assert "ExecReload=/bin/kill -HUP $MAINPID" in lines
    for line in ("Type=notify", "WatchdogSec=2", "Restart=on-failure", "DynamicUser=yes", "KillSignal=SIGTERM"):
        assert line in lines
    assert f"SuccessExitStatus={EXIT_CODE_BASE + signal.SIGTERM}" in lines, "a stop before the robot is ready"
    if shutil.which("systemd-analyze") is not None:
        unit = tmp_path / "echolocate.service"
        unit.write_text(printed.out, "utf-8")
        checked = subprocess.run(
            ["systemd-analyze", "verify", "--man=no", str(unit)],
            capture_output=True, text=True, timeout=600, check=False,
        )  # fmt: skip
        assert str(unit.name) not in checked.stderr, checked.stderr


def test_a_service_without_a_port_is_a_wrong_call(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["service", "hallway"]) == WRONG_CALL
    assert "--port" in capsys.readouterr().err
    assert run_command(["service", "hallway", "--port", "a\nExecStart=b"]) == WRONG_CALL


@pytest.mark.parametrize(
    ("word", "unit"),
    [("/dev/ttyUSB0", "/dev/ttyUSB0"), ("a b", '"a b"'), ("100%", "100%%"), ("$HOME", "$$HOME"), ('"', '"\\""'),
     ("a\\b", '"a\\\\b"'), ("", '""')],
)  # fmt: skip
def test_words_of_a_command_line(word: str, unit: str) -> None:
    assert quote_for_systemd(word) == unit
