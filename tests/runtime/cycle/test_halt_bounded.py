"""P2 in virtual time: the time from a request to the HALT on the line while the process is busy."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest
import structlog

from drivers.denning.codec import Decoder
from drivers.denning.frames import Drive, Frame, Halt
from drivers.driver import RobotDriver
from drivers.messages import Flags
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from runtime.cycle.process import Observers, RobotProcess
from runtime.cycle.step import CycleRecord, State
from runtime.timing.cycle_stats import CycleStats
from tests.runtime.virtual_time import in_virtual_time

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P2")]

CYCLE_S = 0.05
BOUND_S = CYCLE_S + 0.010
TRIALS, SOAK_TRIALS = 200, 1000
"""Requests in `make test` and in `make soak`."""
SOME_BUSY = (0.0, 0.004, 0.03, 0.045)
"""How long a cycle holds the loop, s: perception saturated leaves a tenth of the period."""
UNPLUGGED_EVERY = 10


@dataclass
class Sent:
    """The frames that were sent on the line, and when."""

    decoder: Decoder = field(default_factory=lambda: Decoder("host"))
    frames: list[tuple[float, Frame]] = field(default_factory=list)

    def take(self, way: str, at_s: float, _host_s: float, data: bytes) -> None:
        if way == "out":
            self.frames += [(at_s, frame) for frame in self.decoder.feed(data)]

    def first(self, kind: type[Frame], since_s: float) -> float | None:
        return next((at_s for at_s, frame in self.frames if isinstance(frame, kind) and at_s >= since_s), None)


@pytest.mark.parametrize("trials", [TRIALS, pytest.param(SOAK_TRIALS, marks=pytest.mark.soak)])
def test_halts_at_random_moments(
    monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None], trials: int
) -> None:
    rng, sent, waits_s = random.Random(2), Sent(), list[float]()

    with in_virtual_time(monkeypatch, "perception.method=paper") as (loop, settings, robot, links):
        pending: list[tuple[float, bool]] = []

        def ask(asked_s: float, *, unplug: bool) -> None:
            if unplug:
                links[0].pull()
                loop.call_later(rng.uniform(0.0, 0.15), links[0].plug)
            pending.append((asked_s, unplug))
            process.request(Request.HALT)

        def soon() -> None:
            """Ask at a moment before the next cycle; what holds the loop at that moment delays the request."""
            after_s, unplug = rng.uniform(0.0, CYCLE_S), len(waits_s) % UNPLUGGED_EVERY == 0
            asked_s = loop.time() + after_s
            loop.call_later(after_s, lambda: ask(asked_s, unplug=unplug))

        def measure() -> None:
            asked_s, unplugged = pending[0]
            halted_s = sent.first(Halt, asked_s)
            if halted_s is not None:
                pending.clear()
                waits_s.append(halted_s - (max(asked_s, links[0].opened_s) if unplugged else asked_s))
                drives = [at_s for at_s, frame in sent.frames if isinstance(frame, Drive) and at_s > halted_s]
                assert not drives, "after it no DRIVE is sent"
                assert robot.truth.flags & Flags.LATCHED, "one frame stops the whole base"
                sent.frames.clear()

        def on_cycle(record: CycleRecord, _state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
            mode = record.mode
            if pending and mode.mode is Mode.SAFE_STOP and links[0].is_open:
                measure()
            if len(waits_s) == trials:
                process.stop()
            elif not pending and mode.mode is Mode.DRIVE:
                if not asking and rng.random() < 0.5:
                    asking.append(True)
                    soon()
            elif not pending and mode.arming_run_s is None:
                asking.clear()
                process.request(Request.ARM)
            loop.spend(rng.choice(SOME_BUSY))

        asking: list[bool] = []
        log = structlog.wrap_logger(None, processors=[_drop])
        process = RobotProcess(settings, log, Observers(on_cycle, on_bytes=sent.take), loop.time)
        loop.run_until_complete(process.run(arm=False, seconds=None))
    assert len(waits_s) == trials
    assert min(waits_s) >= 0.0
    assert max(waits_s) <= BOUND_S
    worst_ms = 1e3 * max(waits_s)
    measured(f"{trials} requests at random moments of virtual time: HALT on the line ≤ {worst_ms:.1f} ms later")


def test_a_velocity_delayed_before_the_line_is_followed_by_a_halt(monkeypatch: pytest.MonkeyPatch) -> None:
    """As by SIGSTOP between reading the clock and sending: the base has stopped by itself meanwhile."""
    with in_virtual_time(monkeypatch) as (loop, settings, _robot, _links):
        sent, held = Sent(), list[float]()

        def on_bytes(way: str, at_s: float, host_s: float, data: bytes) -> None:
            before = len(sent.frames)
            sent.take(way, at_s, host_s, data)
            drove = any(isinstance(f, Drive) and f.v_mm_s > 0 for _, f in sent.frames[before:])
            if drove and not held:
                held.append(loop.time())
                loop.spend(1.0)

        def on_cycle(_record: CycleRecord, state: State, _stats: CycleStats, _driver: RobotDriver) -> None:
            if held:
                reasons.append(str(state.mode.reason))
                kinds.append([type(frame) for at_s, frame in sent.frames if at_s >= held[0]])
            if len(kinds) == 2:
                process.stop()

        reasons: list[str] = []
        kinds: list[list[type[Frame]]] = []
        log = structlog.wrap_logger(None, processors=[_drop])
        process = RobotProcess(settings, log, Observers(on_cycle, on_bytes=on_bytes), loop.time)
        summary = loop.run_until_complete(process.run(arm=True, seconds=None))
    assert kinds[0][:2] == [Drive, Halt], "in the same cycle"
    assert not any(kind is Drive for kind in kinds[1][1:])
    assert summary["mode"] == "SAFE_STOP"
    assert reasons[1] in summary["stop_reasons"]


def _drop(*_: object) -> dict[str, object]:
    raise structlog.DropEvent
