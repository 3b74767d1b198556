"""The fleet as a client of real consoles: what it shows, and when a HALT counts as confirmed."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable
from importlib import resources

from runtime.bridges.fleet import CONFIRM_MAX_S, SILENT_S, Fleet, FleetRun
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode, ModeState
from tests.runtime.console.console_case import ConsoleCase, open_console

NOWHERE = "http://127.0.0.1:1/?token=x"


def with_fleet(test: Callable[[ConsoleCase, Fleet, list[float]], Awaitable[None]]) -> None:
    """Run a test on a console that drives, followed by a fleet whose clock stands still."""

    async def body() -> None:
        now_s = [50.0]
        async with open_console() as case:
            fleet = Fleet(lambda: now_s[0], list)
            try:
                assert fleet.add(case.console.url) is None
                await test(case, fleet, now_s)
            finally:
                await fleet.close()

    asyncio.run(body())


async def shows(case: ConsoleCase, fleet: Fleet, key: str, wanted: str) -> None:
    """Run cycles until the first row of the fleet has a value."""

    def is_so() -> bool:
        case.cycles()
        return bool(dict(fleet.rows()[0])[key] == wanted)

    await case.settled(is_so, f"{key} {wanted}: {fleet.rows()}")


def test_a_halt_is_confirmed_by_the_answer_and_a_state_after_it() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, now_s: list[float]) -> None:
        case.run.state.mode = ModeState(Mode.DRIVE)
        await shows(case, fleet, "mode", "DRIVE")
        assert fleet.halt(None) == 1
        await case.settled(lambda: Request.HALT in case.run.asked, "HALT")
        assert fleet.rows()[0]["halt"] == "sent"
        now_s[0] += CONFIRM_MAX_S + 0.1
        await shows(case, fleet, "halt", "unconfirmed")
        case.run.state.mode = ModeState(Mode.SAFE_STOP)
        await shows(case, fleet, "halt", "confirmed")
        case.run.state.mode = ModeState(Mode.DRIVE)  # armed again: an earlier HALT says nothing
        await shows(case, fleet, "halt", "none")

    with_fleet(body)


async def test_a_halt_that_is_not_confirmed_is_shown_within_a_second() -> None:
    """A run that hangs at any moment: the fleet's clock and the times of its page are added up."""
    now_s, script = [50.0], (resources.files("runtime") / "console" / "page" / "fleet.js").read_text("utf-8")
    found = [re.findall(rf"const {name}_MS = (\d+)", script) for name in ("EVERY", "UNSENT")]
    every_s, unsent_s = (int(numbers[0]) / 1000.0 for numbers in found)
    fleet = Fleet(lambda: now_s[0], list)
    fleet.runs.append(FleetRun(NOWHERE, is_local=False))
    fleet.halt(None)
    now_s[0] += 0.95 - every_s
    assert fleet.rows()[0]["halt"] == "unconfirmed"
    assert unsent_s + every_s <= 0.95
    await fleet.close()


def test_a_run_that_came_back_after_its_end_is_not_over() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, _now_s: list[float]) -> None:
        fleet.runs[0].is_over = True  # it said so before it started again
        await shows(case, fleet, "problem", "")
        assert not fleet.runs[0].is_over

    with_fleet(body)


def test_control_of_the_run_is_left_to_its_page() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, _now_s: list[float]) -> None:
        await shows(case, fleet, "problem", "")
        hub = case.console.hub
        await case.settled(lambda: not any(map(hub.control.is_held_by, hub.clients.values())), "control that is free")
        page = await case.connect()
        assert (await page.next("session"))["role"] == "control"

    with_fleet(body)


def test_a_run_that_is_not_reached_or_silent_is_named() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, now_s: list[float]) -> None:
        case.run.state.mode = ModeState(Mode.DRIVE)
        await shows(case, fleet, "mode", "DRIVE")
        assert fleet.add(NOWHERE) is None
        assert fleet.halt("127.0.0.1:1") == 1
        await case.settled(lambda: "no run answers" in fleet.rows()[1]["problem"], "the problem")
        now_s[0] += max(CONFIRM_MAX_S, SILENT_S) + 0.1
        silent, missing = fleet.rows()
        assert silent["problem"].startswith("nothing has come for")
        assert (silent["halt"], missing["halt"]) == ("none", "unconfirmed")

    with_fleet(body)


def test_a_row_says_where_the_robot_is_and_holds_no_token() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, _now_s: list[float]) -> None:
        page = await case.page()
        await page.ask(type="set_places", places={"place": [{"name": "charger", "x_m": 0.1, "y_m": 0.0}]})
        case.cycle = 0
        await shows(case, fleet, "place", "at charger")
        row = fleet.rows()[0]
        assert row["battery"] == "no warning"
        assert case.token not in str(row)

    with_fleet(body)


def test_an_address_without_token_is_refused_and_a_new_run_on_its_port_replaces_the_old_one() -> None:
    async def body(case: ConsoleCase, fleet: Fleet, _now_s: list[float]) -> None:
        assert "with its token" in (fleet.add(case.origin) or "")
        assert "already" in (fleet.add(case.console.url) or "")
        assert fleet.add(f"{case.origin}/?token=another") is None
        assert len(fleet.runs) == 1

    with_fleet(body)


def test_runs_of_this_machine_come_and_go() -> None:
    async def body() -> None:
        found = [NOWHERE]
        fleet = Fleet(lambda: 0.0, lambda: found)
        watching = asyncio.create_task(fleet.watch_local())
        while not fleet.runs:
            await asyncio.sleep(0.01)
        fleet.runs[0].state = {"mode": "DRIVE", "flags": [], "pose": [0.0, 0.0, 0.0]}
        found.clear()
        while fleet.runs[0].is_local:  # killed: the robot may be without a program
            await asyncio.sleep(0.01)
        assert [row["address"] for row in fleet.rows()] == ["127.0.0.1:1"]
        fleet.runs[0].is_local = fleet.runs[0].is_over = True
        while fleet.runs:
            await asyncio.sleep(0.01)
        watching.cancel()
        await asyncio.gather(watching, return_exceptions=True)
        await fleet.close()

    asyncio.run(body())


async def test_a_place_has_no_minus_before_zero() -> None:
    fleet = Fleet(lambda: 50.0, list)
    fleet.runs.append(
        FleetRun(NOWHERE, is_local=False, state={"mode": "READY", "flags": [], "pose": [-0.04, 1.0, 0.0]})
    )
    assert fleet.rows()[0]["place"] == "0.0, 1.0 m from its start"
