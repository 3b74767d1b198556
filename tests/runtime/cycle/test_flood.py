"""A flood of valid frames of any kind: bounded work in a cycle, a SAFE_STOP with its reason, and a line."""

from __future__ import annotations

import random
from typing import Any

import pytest

from drivers.arcos import codec as arcos
from drivers.arcos.frames import EncoderPacket, IoPacket, RobotName, SyncEcho
from drivers.denning import codec as denning
from drivers.denning.frames import Ack, Echo, Nak, Odom
from drivers.rflex import codec as rflex
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from tests.runtime.cycle.test_line_messages import Events
from tests.runtime.virtual_time import STEP_S, in_virtual_time

pytestmark = pytest.mark.promise("P22")

FRAMES: dict[str, tuple[bytes, ...]] = {
    "denning": (
        denning.encode(Ack(1, 2)), denning.encode(Nak(1, 2, 3)), denning.encode(Echo(1, 10**9, 0, 1, (9,))),
        denning.encode(Odom(1, 10**9, 0, 0, 0, 0, 0, 0, 0, 0)),
    ),
    "p3dx": (
        arcos.encode(SyncEcho(0)), arcos.encode(RobotName("a", "Pioneer", "p3dx")), arcos.encode(EncoderPacket(1, 2)),
        arcos.encode(IoPacket(b"", b"", ())),
    ),
    "b21r": (
        rflex.encode(rflex.frame_of(rflex.Status(1, 2400, 0))), rflex.encode(rflex.frame_of(rflex.Input(1, 64, 0))),
        rflex.encode(rflex.frame_of(rflex.SonarReport(1, ((96, 900),)))),
    ),
}  # fmt: skip


RATES = (1e5, 5e5, 2e6)
"""Bytes a second; a line of 115,200 baud carries 11,520."""


@pytest.mark.parametrize("robot_file", FRAMES)
def test_a_flood_of_valid_frames_ends_the_drive_with_bounded_work(
    robot_file: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = random.Random(robot_file)
    check_flood(robot_file, rng.choice(FRAMES[robot_file]), 10.0 ** rng.uniform(5.7, 6.3), monkeypatch)


@pytest.mark.soak
@pytest.mark.parametrize("bytes_s", RATES)
@pytest.mark.parametrize(
    ("robot_file", "number"), [(r, i) for r, frames in FRAMES.items() for i in range(len(frames))]
)
def test_a_flood_of_each_kind_and_rate(
    robot_file: str, number: int, bytes_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    check_flood(robot_file, FRAMES[robot_file][number], bytes_s, monkeypatch)


def check_flood(robot_file: str, frame: bytes, bytes_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Flood a driving robot with one frame, and check mode, work and log."""
    events = Events()
    with in_virtual_time(monkeypatch, "perception.method=paper", robot_file=robot_file) as (loop, settings, _, links):
        work, last, modes = list[int](), [0], list[Mode]()

        def on_cycle(_record: Any, _state: Any, _stats: Any, driver: Any) -> None:
            work.append(driver.counts.frames - last[0])
            last[0] = driver.counts.frames

        process = RobotProcess(settings, events.log, Observers(on_cycle=on_cycle), clock=loop.time)

        def flood() -> None:
            piece = frame * round(bytes_s * STEP_S / len(frame))
            for at in range(0, len(piece), 4096):
                links[0]._calls[1](piece[at : at + 4096])
            loop.call_later(STEP_S, flood)

        loop.call_later(1.2, lambda: modes.append(process.state.mode.mode))
        loop.call_later(1.2, flood)
        loop.call_later(3.5, lambda: modes.append(process.state.mode.mode))
        loop.call_later(3.5, lambda: process.request(Request.ARM))
        summary = loop.run_until_complete(process.run(arm=True, seconds=4.0))
    assert modes[1] is Mode.SAFE_STOP
    if robot_file != "b21r":  # it is stopped in this hall before the flood begins
        assert modes[0] is Mode.DRIVE
    assert summary["mode"] != "DRIVE", "it is not armed while the flood lasts"
    assert max(work) <= 20_480 / len(frame) + 0.1 * 65_536 / len(frame) + 100
    assert sum("line flooded" in str(event.get("event")) for event in events.events) == 1
    assert any("more bytes than a robot sends" in text for text in events.texts())
