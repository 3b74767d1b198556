"""The offer of a robot that is plugged in: asked for, declined, not one, several, and ports that are left alone."""

from __future__ import annotations

import io
import os
import tty
from collections.abc import Mapping

import pytest
from serial.tools.list_ports_common import ListPortInfo

from config.load import load_settings
from config.robot import RobotConfig
from runtime.cli.app import run_command
from runtime.cli.commands.robots import port_probe
from runtime.cli.commands.robots.port_probe import Finding
from runtime.cli.commands.run import offer
from runtime.cli.commands.run.offer import Offered, ask_for_robot, plugged_in
from runtime.cli.commands.run.run_plan import RunPlan
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.restart import VARIABLE

FOUND = {
    "/dev/ttyUSB0": Finding("p3dx", ("robot 'Anna', 16 sensors; battery 12.6 V",)),
    "/dev/ttyUSB1": Finding(None, ("nothing answers",)),
    "/dev/ttyUSB2": Finding("b21r", ("robot 'B21r', 24 sensors; battery 24.3 V",)),
}


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    """The robots that are tried on each port; `FOUND` says which answer."""
    names = list[list[str]]()

    async def probe_port(port: str, robots: Mapping[str, RobotConfig]) -> Finding:
        names.append(sorted(robots))
        name = FOUND[port].robot
        return FOUND[port] if name is None or name in robots else Finding(next(iter(robots)), FOUND[port].said)

    monkeypatch.setattr(port_probe, "probe_port", probe_port)
    return names


def ask(*ports: str, answer: str = "", chosen: RobotConfig | None = None) -> tuple[Offered | None, str]:
    screen = io.StringIO()
    return ask_for_robot(
        list(ports), chosen, EscapingConsole(screen, soft_wrap=True), io.StringIO(answer)
    ), screen.getvalue()


def test_nothing_is_offered_after_a_restart(monkeypatch: pytest.MonkeyPatch) -> None:
    """The person who pressed the button on the page does not sit at the terminal."""
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: pytest.fail("it looks for robots"))
    monkeypatch.setenv(VARIABLE, "8765 secret")
    assert plugged_in() == []


@pytest.mark.usefixtures("tried")
def test_the_only_robot_is_named_and_runs_only_on_yes() -> None:
    found, screen = ask("/dev/ttyUSB0", "/dev/ttyUSB1", answer="y\n")
    assert found == Offered("/dev/ttyUSB0", "p3dx")
    assert "/dev/ttyUSB0: robot 'Anna', 16 sensors; battery 12.6 V" in screen
    assert "run it: echolocate run --robot p3dx --port /dev/ttyUSB0" in screen
    for answer in ("\n", "", "n\n", "yes please\n"):  # the second is the end of the input
        assert ask("/dev/ttyUSB0", answer=answer)[0] is None


@pytest.mark.usefixtures("tried")
def test_several_robots_are_listed_and_none_is_offered() -> None:
    found, screen = ask(*FOUND, answer="y\n")
    assert found is None
    assert "--robot p3dx --port /dev/ttyUSB0" in screen
    assert "--robot b21r --port /dev/ttyUSB2" in screen
    assert "[y/N]" not in screen
    assert "[y/N]" not in ask("/dev/ttyUSB1")[1]


def test_with_a_robot_that_is_chosen_only_that_is_looked_for(tried: list[list[str]]) -> None:
    found, screen = ask("/dev/ttyUSB0", answer="yes\n", chosen=load_settings(None, (), robot="p3at"))
    assert found == Offered("/dev/ttyUSB0", None)
    assert "the same command with --port /dev/ttyUSB0" in screen
    assert [len(names) for names in tried] == [1]


def test_a_port_that_another_program_has_open_is_left_alone(
    tried: list[list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot, line = os.openpty()
    tty.setraw(line)
    port = os.ttyname(line)
    assert not offer._is_open_elsewhere(port), "it is this program's own"
    monkeypatch.setattr(os, "getpid", lambda: 0)
    assert f"{port} is in use by another program" in ask(port)[1]
    assert not tried
    os.close(line)
    os.close(robot)


def test_only_usb_devices_may_be_robots(monkeypatch: pytest.MonkeyPatch) -> None:
    adapter, on_board = ListPortInfo("/dev/ttyUSB0"), ListPortInfo("/dev/ttyS0")
    adapter.vid = 0x0403
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: [adapter, on_board])
    assert plugged_in() == ["/dev/ttyUSB0"]


class RunStartedError(Exception):
    """The run would begin now; carries its port, and more of it."""


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """A terminal with a robot plugged in; a run ends where it would open its port."""

    def begins(settings: RobotConfig) -> None:
        raise RunStartedError(settings.link.port, settings.robot.driver)

    monkeypatch.setattr(EscapingConsole, "is_terminal", property(lambda _: True))
    monkeypatch.setattr(EscapingConsole, "is_dumb_terminal", property(lambda _: False))
    monkeypatch.setattr("sys.stdin", io.StringIO("y\n"))
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr(offer, "plugged_in", lambda: ["/dev/ttyUSB0"])
    monkeypatch.setattr("runtime.support.kernel_loader.begin_preparation", begins)
    return monkeypatch


@pytest.mark.usefixtures("tried")
def test_a_robot_that_was_offered_is_not_armed_whatever_the_command_line_says(terminal: pytest.MonkeyPatch) -> None:
    async def begins(plan: RunPlan, *_: object, **__: object) -> None:
        raise RunStartedError(plan.settings.link.port, plan.is_armed)

    terminal.setattr("runtime.support.kernel_loader.begin_preparation", lambda _: None)
    terminal.setattr("runtime.cli.commands.run.run_process.run_process", begins)
    with pytest.raises(RunStartedError) as error:
        run_command(["run", "--arm", "--no-record", "--no-console"])
    assert error.value.args == ("/dev/ttyUSB0", False)


@pytest.mark.usefixtures("tried", "terminal")
@pytest.mark.parametrize(
    ("options", "started"),
    [
        ([], ("/dev/ttyUSB0", "arcos")),
        (["--robot", "p3at"], ("/dev/ttyUSB0", "arcos")),
        (["--headless"], (None, "denning")),
        (["--world", "hallway"], (None, "denning")),
        (["--port", "/dev/ttyS7"], ("/dev/ttyS7", "denning")),
    ],
)
def test_run_offers_it_on_a_terminal_unless_port_or_emulator_are_chosen(
    options: list[str], started: tuple[str | None, str]
) -> None:
    with pytest.raises(RunStartedError) as error:
        run_command(["run", "--no-record", "--no-console", *options])
    assert error.value.args == started
