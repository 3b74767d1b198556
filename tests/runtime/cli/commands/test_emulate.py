"""Tests of `echolocate emulate`: what it gives to the emulator, and when it says that it is ready."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, WRONG_CALL
from drivers.emulator.faults import Reboot
from drivers.emulator.server import Service
from runtime.cli.app import run_command
from runtime.cli.commands.emulate import PIPES

FAULTS = "[[fault]]\nat_s = 1.0\nkind = 'reboot'\nduration_s = 0.5\n"


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Put a stub in place of the emulator; return what it was given."""
    calls: list[dict[str, Any]] = []

    async def serve(settings: object, world: object, *, ready: Any, **options: Any) -> None:
        calls.append({"settings": settings, "world": world, **options})
        ready("/dev/pts/9")

    monkeypatch.setattr("drivers.emulator.server.serve", serve)
    return calls


def test_every_option_reaches_the_emulator(
    served: list[dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "faults.toml").write_text(FAULTS, "utf-8")
    words = [
        "--link", "robot", "--faults", str(tmp_path / "faults.toml"), "--seed", "7", "--trace", "t.csv", "--latency",
        "l.csv", "--clock", "4.5", "--control", "--end-with-parent", "--set", "cycle.rate_hz=10",
    ]  # fmt: skip
    assert run_command(["emulate", *words]) == DONE
    assert capsys.readouterr().out == "ready on /dev/pts/9\n"
    (call,) = served
    assert call["settings"].cycle.rate_hz == 10.0
    assert call["world"] == call["settings"].world
    assert [type(fault) for fault in call["faults"]] == [Reboot]
    assert call["seed"] == 7
    assert call["service"] == Service(
        "t.csv", "l.csv", exit_with_parent=True, clock_start_us=4_500_000, control=PIPES
    )
    assert call["make_port"].args == ("robot",)


def test_by_default_nothing_is_written_and_no_fault_is_planned(served: list[dict[str, Any]]) -> None:
    assert run_command(["emulate", "--world", "irregular"]) == DONE
    (call,) = served
    assert len(call["world"].drum) == 8
    assert (call["faults"], call["seed"], call["service"]) == ((), 0, Service())
    assert call["make_port"].args == (None,)


@pytest.mark.parametrize(
    ("text", "address"),
    [("8101", ("127.0.0.1", 8101)), ("0.0.0.0:0", ("0.0.0.0", 0)), ("[::1]:8101", ("::1", 8101))],
)
def test_a_tcp_port_is_of_this_machine_unless_it_says_otherwise(
    served: list[dict[str, Any]], text: str, address: tuple[str, int]
) -> None:
    assert run_command(["emulate", "--tcp", text]) == DONE
    assert served[0]["make_port"].args == address


@pytest.mark.parametrize("words", [["x"], ["99999"], [":8101"], ["host:"], ["8101", "--link", "robot"]])
def test_a_wrong_tcp_port_is_one_line(
    served: list[dict[str, Any]], words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["emulate", "--tcp", *words]) == WRONG_CALL
    assert "--tcp" in capsys.readouterr().err
    assert served == []


@pytest.mark.parametrize("clock", ["-1", "4294.967296", "nan"])
def test_the_robot_s_clock_has_32_bits_of_microseconds(
    served: list[dict[str, Any]], clock: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(["emulate", "--clock", clock]) == WRONG_CALL
    assert "--clock" in capsys.readouterr().err
    assert served == []
