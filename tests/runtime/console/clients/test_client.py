"""What clients are shown and told: the newest frame, what they missed, and nobody waits for any of them."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson
import pytest

from perception.edits import ConfirmObject, RejectObject
from runtime.console.clients.client import Client
from runtime.console.clients.control import REQUEST_TIMEOUT_S as CONTROL_S
from runtime.console.frames.frame_encoder import EncodedFrame
from runtime.console.http.client_limits import Limits
from runtime.cycle.inputs import Request
from tests.rawpage import RawPage
from tests.runtime.console.console_case import ConsoleCase, open_console

Segments = dict[int, list[float]]


def apply(segments: Segments, told: dict[str, Any]) -> None:
    """Do as the page does."""
    if told["whole"]:
        segments.clear()
    for number in told["removed"]:
        del segments[number]
    for number, *row in told["added"]:
        assert number not in segments
        segments[number] = row


def agree(segments: Segments, case: ConsoleCase) -> None:
    """Assert that the page knows what is in the map."""
    now = case.run.state.perception.segments()
    assert sorted(segments) == sorted(now.numbers.tolist())
    for number, ends in zip(now.numbers.tolist(), now.geometry.tolist(), strict=True):
        assert segments[number][:5] == pytest.approx(ends, abs=1e-4)


async def test_the_greeting() -> None:
    async with open_console() as case:
        page = await case.page()
        session = page.received[0]
        assert session["role"] == "control"
        assert session["name"] == "denning"
        assert session["emulated"] is True
        assert len(session["ring"]["mounts"]) == 24
        assert len(session["truth"]["drums"]) == 6
        assert session["models"][0]["name"] == "semicircle"
        assert session["period_s"] == 0.05
        paths = {parameter["path"] for parameter in session["parameters"]}
        assert {"behaviors.avoid_static_obstacle.avoid_obstacle_gain", "cycle.perception_budget_s"} <= paths
        assert (await case.page()).received[0]["role"] == "watch"


async def test_on_a_port_nobody_knows_the_truth() -> None:
    async with open_console(emulated=False) as case:
        assert (await case.page()).received[0]["truth"] is None


async def test_who_came_before_the_robot_had_answered_hears_its_name() -> None:
    async with open_console() as case:
        case.run.name = None
        page = await case.page()
        assert page.received[0]["name"] is None
        case.run.name = "denning"
        case.cycles()
        assert (await page.next("session"))["name"] == "denning"


async def test_a_frame() -> None:
    async with open_console() as case:
        page = await case.page()
        case.cycles(3)
        frame = await page.next("state")
        assert frame["cycle"] == 3
        assert frame["mode"] == "CONNECTING"
        assert frame["pose"] == [0.06, 0.0, 0.0]
        assert frame["twist"] == [0.3, 0.0]
        assert frame["firing"] == [1, 2, 3, 9, 10, 11, 17, 18, 19], "those of all cycles since the last frame"
        assert (frame["ranges"][3], frame["ranges"][11], frame["ranges"][0]) == (1.5, -1.0, None)
        assert (frame["age"][3], frame["age"][1], frame["age"][0]) == (0.0, 0.1, None)
        assert frame["link"] == {"frames": 7, "bad": 1, "lost": 2}
        assert frame["quanta"] == 2
        assert frame["refinement"] == "quota"
        assert frame["drive_request"]["kind"] == "legs"
        assert frame["controller"] is True
        assert frame["clients"] == 1
        assert frame["recording"] is None
        assert frame["paused"] is False


async def test_frames_are_built_only_while_somebody_looks_on(monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_console() as case:
        made: list[int] = []
        encode = case.console._publisher._encoder.frame

        def counted(*how: Any) -> EncodedFrame:
            made.append(1)
            return encode(*how)

        monkeypatch.setattr(case.console._publisher._encoder, "frame", counted)
        case.cycles(50)
        await asyncio.sleep(0.0)
        assert sum(made) == 0
        page, another = await case.page(), await case.page()
        case.cycles()
        await page.next("state")
        await another.next("state")
        assert sum(made) == 1, "one for all"


async def test_no_more_than_twenty_a_second() -> None:
    async with open_console() as case:
        page = await case.page()
        before = case.console._publisher._encoder._number
        for _ in range(200):
            case.cycles(step_s=0.005)
            await asyncio.sleep(0.0)
        assert 19 <= case.console._publisher._encoder._number - before <= 22
        before = case.console._publisher._encoder._number
        for _ in range(40):
            case.cycles(step_s=0.051)
            await asyncio.sleep(0.0)
        assert case.console._publisher._encoder._number - before == 40, "a cycle that is a little late has its frame"
        await page.next("state")


async def test_while_cycles_overrun_nothing_is_shown() -> None:
    async with open_console() as case:
        page = await case.page()
        before = case.console._publisher._encoder._number
        case.run.timing_monitor.overruns_in_a_row = 1
        for _ in range(10):
            case.cycles()
            await asyncio.sleep(0.0)
        assert case.console._publisher._encoder._number == before
        case.run.timing_monitor.overruns_in_a_row = 0
        case.cycles()
        assert (await page.next("state"))["cycle"] == 11


async def test_changes_add_up_to_the_whole() -> None:
    async with open_console() as case:
        page, segments = await case.page(), Segments()
        for k in range(60):
            case.cycles()
            frame = await page.next("state")
            apply(segments, frame["segments"])
            assert frame["segments"]["whole"] == (k == 0)
            assert frame["dropped"] == 0
            agree(segments, case)
        assert segments, "nothing was in the map: this says nothing"


async def test_who_comes_later_gets_the_whole() -> None:
    async with open_console() as case:
        first = await case.page()
        case.cycles(40)
        await first.next("state")
        page, segments = await case.page(), Segments()
        case.cycles()
        frame = await page.next("state")
        assert frame["segments"]["whole"]
        apply(segments, frame["segments"])
        agree(segments, case)


class DeafWire:
    """Takes so many messages and no more."""

    def __init__(self, takes: int = 0) -> None:
        self.takes = takes
        self.sent: list[bytes] = []
        self.aborted = False
        self.more = asyncio.Event()

    async def send(self, data: bytes) -> None:
        while len(self.sent) >= self.takes:
            self.more.clear()
            await self.more.wait()
        self.sent.append(data)

    def abort(self) -> None:
        self.aborted = True


async def test_a_slow_client_misses_frames_and_gets_the_newest_with_the_whole() -> None:
    async with open_console() as case:
        case.cycles()
        wire = DeafWire(2)
        client = case.console.hub.join(wire, "slow", case.console._session(), has_token=False)
        sender = asyncio.create_task(client.send_all())
        quick = await case.page()
        for _ in range(30):
            case.cycles()
            await quick.next("state")
        assert len(wire.sent) == 2, "the greeting and a frame"
        wire.takes = 4
        wire.more.set()
        await case.settled(lambda: len(wire.sent) == 4, "two more frames")
        behind, newest = orjson.loads(wire.sent[2]), orjson.loads(wire.sent[3])
        assert behind["cycle"] == 3, "was on its way"
        assert newest["cycle"] == 31
        assert newest["dropped"] == 27
        assert newest["segments"]["whole"]
        case.console.hub.leave(client)
        client.leave()
        await sender


async def test_one_that_never_reads_costs_no_more_than_its_slot() -> None:
    limits = Limits(stall_s=10.0)
    async with open_console(limits=limits) as case:
        deaf = await asyncio.to_thread(RawPage, case.console.url, receive_bytes=4096)
        client, page = case.console.hub.clients[1], await case.page()
        held: list[int] = []
        while client._sending_since_s is None:
            assert len(held) < 2000, "it takes everything: this says nothing"
            case.cycles()
            assert (await page.next("state"))["cycle"] == len(held) + 1
            held.append(buffered(case))
        for _ in range(150):
            case.cycles()
            await page.next("state")
            held.append(buffered(case))
        assert client.number in case.console.hub.clients
        assert max(held) < 32_768, "no frame waits behind another"
        case.cycles(step_s=300.0)
        await case.settled(lambda: 1 not in case.console.hub.clients, "that it is let go")
        assert any("it took nothing for 10 s" in why for why in case.refusals())
        deaf.close()


def buffered(case: ConsoleCase) -> int:
    """Return how much this process keeps for a client that does not take it."""
    assert case.console._server is not None
    talks = case.console._server._websockets.values()
    return max(talk._writer.transport.get_write_buffer_size() for talk in talks)  # type: ignore[union-attr]


async def test_answers_that_nobody_takes_are_bounded() -> None:
    wire = DeafWire()
    client = Client(1, "deaf", wire, Limits(queue_messages=10), lambda: 0.0, has_token=True)
    for _ in range(10):
        assert not client.is_gone
        client.send({"type": "answer"})
    client.send({"type": "answer"})
    assert wire.aborted
    assert client.is_gone
    client.send({"type": "answer"})
    another = Client(
        2, "deaf", wire := DeafWire(), Limits(queue_messages=1000, queue_bytes=1000), lambda: 0.0, has_token=True
    )
    for _ in range(200):
        another.send_if_room(b"x" * 10)
    another.send_encoded(b"x" * 1000)
    assert wire.aborted


async def test_lines_of_the_log_also_for_those_who_come_later() -> None:
    async with open_console() as case:
        page = await case.page()
        case.console.hub.on_log({"event": "mode", "level": "info", "timestamp": "now", "mode": "READY", "cycle": 3})
        line = await page.next("log")
        assert line == {"type": "log", "timestamp": "now", "level": "info", "event": "mode",
                        "fields": {"mode": "READY", "cycle": "3"}}  # fmt: skip
        later = await case.connect()
        assert await later.next("log") == line
        await asyncio.to_thread(case.console.hub.on_log, {"event": "from a thread", "level": "warning"})
        assert (await page.next("log"))["event"] == "from a thread"


async def test_the_control_changes_hands() -> None:
    async with open_console() as case:
        first, second = await case.page(), await case.page()
        answer = await second.ask(type="arm")
        assert not answer["ok"]
        assert answer["error"] == "another client has control: ask for it first"
        assert case.refusals()[-1] == answer["error"], "two that want to drive: refused, and logged"
        assert not (await second.ask(type="take_control"))["ok"]
        asked = await first.next("role")
        assert asked["role"] == "control"
        assert asked["asked_by"] == "client 2 (127.0.0.1)"
        assert (await first.ask(type="grant_control", client=asked["client"]))["ok"]
        assert (await second.next("role"))["role"] == "control"
        assert not (await first.ask(type="arm"))["ok"]
        assert (await second.ask(type="arm"))["ok"]
        assert case.run.asked == [Request.ARM]
        case.cycles()
        assert (await second.next("state"))["controller"] is True
        assert (await first.next("state"))["controller"] is False
        assert (await first.ask(type="halt"))["ok"], "whoever sees it may stop it"


async def test_a_holder_who_is_asked_and_idle_loses_it() -> None:
    async with open_console() as case:
        _first, second = await case.page(), await case.page()
        await second.ask(type="take_control")
        case.cycles(step_s=CONTROL_S + 1.0)
        assert (await second.next("role"))["role"] == "control"


async def test_a_page_that_is_closed_takes_its_hand_off_the_stick() -> None:
    async with open_console() as case:
        page, other = await case.page(), await case.page()
        assert (await page.ask(type="teleoperate", v=0.2, w=0.0))["ok"]
        transport = page.socket._conn.transport  # type: ignore[union-attr]
        assert transport is not None
        transport.abort()
        await case.settled(lambda: len(case.run.asked) == 2, "standing")
        assert [(w.v, w.w) for w in case.run.asked] == [(0.2, 0.0), (0.0, 0.0)]  # type: ignore[attr-defined]
        assert (await other.ask(type="take_control"))["ok"], "nobody has it any more"


async def test_a_page_that_is_closed_leaves_a_goal_alone() -> None:
    async with open_console() as case:
        page = await case.page()
        await page.ask(type="teleoperate", v=0.2, w=0.0)
        await page.ask(type="goal", x=1.0, y=2.0)
        await page.socket.close()
        await case.settled(lambda: not case.console.hub.clients, "that it is gone")
        assert len(case.run.asked) == 2


async def test_edits_are_answered_once_a_cycle_has_done_them() -> None:
    async with open_console() as case:
        page = await case.page()
        first = await page.send(type="confirm_object", object=3)
        second = await page.send(type="reject_object", object=4)
        await case.settled(lambda: len(case.run.asked) == 2, "both")
        case.cycles()
        edits = (ConfirmObject(3), RejectObject(4))
        assert tuple(case.run.asked) == edits
        case.cycles(edits=edits, outcomes=(None, "there is no object 4"))
        assert (await page.answer(first))["ok"]
        assert (await page.answer(second))["error"] == "there is no object 4"
        case.run.room = 0
        assert "too many edits" in (await page.ask(type="clear_map"))["error"]


async def test_frames_go_on_while_no_cycle_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.console.frames.frame_publisher.IDLE_PERIOD_S", 0.02)
    async with open_console() as case:
        page = await case.page()
        case.clock[0] += 1.0
        assert (await page.next("state"))["cycle"] == 0


@pytest.mark.parametrize("where", ["frame", "take"])
async def test_a_console_that_fails_says_so(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A display with a fault in it must neither go on in silence nor take the loop with it."""
    async with open_console() as case:
        page = await case.page()
        monkeypatch.setattr(case.console._publisher._encoder, where, lambda *_: 1 / 0)
        assert case.run.health.fault() is None
        case.cycles(3)
        await asyncio.sleep(0.0)
        case.cycles(3)
        fault = case.run.health.fault()
        assert fault is not None
        assert "the part `console` of this program has ended (ZeroDivisionError" in fault
        assert len([line for line in case.log if "cannot show the run" in str(line["event"])]) == 1
        assert (await page.ask(type="halt"))["ok"], "to halt works to the last"
        case.console._publisher.failure = None
        case.run.health._ended.clear()


@pytest.mark.parametrize("name", ["console sender 1", "console client 1"])
async def test_a_task_of_a_client_that_is_killed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_console() as case:
        page = await case.page()
        if name == "console client 1":
            monkeypatch.setattr(case.console.dispatcher, "_run", lambda *_: 1 / 0)
            await page.send(type="halt")
        else:
            (task,) = [task for task in asyncio.all_tasks() if task.get_name() == name]
            task.cancel()
        await case.settled(lambda: not case.console.hub.clients, "that the client is let go")
        fault = case.run.health.fault()
        assert fault is not None
        assert name in fault
        assert case.run.health.fault() is None, "it is over; others may come"
        await case.page()
