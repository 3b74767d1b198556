"""The commands on the settings files, over a websocket."""

from __future__ import annotations

from pathlib import Path

from runtime.cycle.modes import Mode, ModeState
from tests.runtime.console.console_case import ConsoleCase, open_console
from tests.runtime.console.files.test_settings_files import Run


async def test_the_commands_over_a_websocket(tmp_path: Path) -> None:
    run = Run(tmp_path)
    async with open_console(settings_files=run.files) as case:
        page = await case.page()
        number = run.number("mine.toml")
        assert len((await page.ask(type="list_settings"))["data"]) == 4
        held = (await page.ask(type="read_settings", file=number))["data"]
        answer = await page.ask(type="check_settings", file=number, toml="[ring\n" + held["text"])
        assert answer["data"]["problems"][0]["line"] == 1
        text = "# mine\n" + held["text"]
        answer = await page.ask(type="change_settings", file=number, toml=text, path="ring.count", value=3)
        assert "no field of this file's form" in answer["error"]
        assert (await page.ask(type="save_settings", file=number, toml=text, digest=held["digest"]))["ok"]
        assert run.robot.read_text() == text
        enter(case, Mode.DRIVE)
        assert "drives" in (await page.ask(type="restart_run"))["error"]
        enter(case, Mode.READY)
        assert (await page.ask(type="restart_run"))["ok"]
    assert run.restarts == 1


def enter(case: ConsoleCase, mode: Mode) -> None:
    """Let the robot be in a mode."""
    case.run.state.mode = ModeState(mode)
