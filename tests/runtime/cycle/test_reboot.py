"""P7: a restart of the robot is detected at any moment of a run: it stands until re-armed, with an empty map."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import pytest

from config.load import load_settings
from drivers.denning.device import DenningDevice
from drivers.driver import LineState
from drivers.emulator.faults import Reboot
from drivers.emulator.memory_transport import MemoryLine
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Firing, Pose
from drivers.registry import make_driver
from perception.pipeline import Perception
from runtime.cycle.inputs import Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State, apply_command, step
from runtime.timing.refinement_budget import within_quanta_per_cycle

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P7")]

SETTINGS = load_settings("hallway")
PERIOD_S = 1.0 / SETTINGS.cycle.rate_hz
FT = 0.3048
STANDS_WITHIN_S = 1.0
"""The deadman's half second is over by then, and the ramp."""


@dataclass
class Run:
    """The whole program in virtual time, on a robot that restarts."""

    reboot_s: float
    down_s: float
    method: Literal["paper", "bayes"] = "paper"
    clock_start_us: int = 0
    run_s: float = 0.0
    firings: list[Firing] = field(default_factory=list)
    records: list[CycleRecord] = field(default_factory=list)
    truths: list[GroundTruth] = field(default_factory=list)

    def __post_init__(self) -> None:
        settings = load_settings("hallway", [f"perception.method={self.method}"])
        assert settings.world is not None
        fault = Reboot(kind="reboot", at_s=self.reboot_s, duration_s=self.down_s)
        self.robot = DenningDevice(
            settings, settings.world, seed=7, faults=(fault,), clock_start_us=self.clock_start_us
        )
        self.driver = make_driver(settings)
        self.line = MemoryLine(self.driver, self.robot)
        self.settings = settings
        self.state = State(Perception(settings.ring, settings.models, settings.perception))

    def cycle(self, request: Request | None = None) -> CycleRecord:
        self.run_s = (len(self.records) + 1) * PERIOD_S
        self.line.exchange(self.run_s)
        inputs = gather_inputs(self.driver, self.run_s, request)
        record = step(
            self.state, inputs, self.settings, lambda c: apply_command(self.driver, c), within_quanta_per_cycle
        )
        self.firings += inputs.received.firings
        self.records.append(record)
        self.truths.append(self.robot.truth)
        return record

    def until(self, done: Callable[[], bool], timeout_s: float, request: Request | None = None) -> None:
        give_up_s = self.run_s + timeout_s
        while not done():
            assert self.run_s < give_up_s, (self.state.mode, self.driver.state, self.driver.problem)
            self.cycle(request)
            request = None

    @property
    def mode(self) -> Mode:
        return self.state.mode.mode

    def reboot_seen(self) -> bool:
        return self.records[-1].inputs.received.rebooted

    def drive(self) -> None:
        self.until(lambda: self.mode is Mode.READY, 2.0)
        self.until(lambda: self.mode is Mode.DRIVE, 2.0, Request.ARM)

    def go_through_the_reboot(self) -> float:
        """Drive up to the reboot and through it, unarmed; return after how long the program stood in SAFE_STOP."""
        self.drive()
        self.until(lambda: self.run_s >= self.reboot_s, self.reboot_s + 1.0)
        self.until(lambda: self.mode is Mode.SAFE_STOP, 2.0)
        stopped_s = self.run_s - self.reboot_s
        if not any(record.inputs.received.rebooted for record in self.records):
            self.until(self.reboot_seen, self.down_s + 2.0)
        return stopped_s


def in_frame_of(origin: Pose, place: tuple[float, float]) -> tuple[float, float]:
    seen = origin.inverse().compose(Pose(*place, 0.0))
    return seen.x, seen.y


PHASES = [2.0 + 0.0137 * k for k in range(24)]
DOWN = (0.0, 0.05, 0.3, 1.3)


def test_after_a_reboot_in_any_phase_it_stands_until_re_armed(measured: Callable[[str], None]) -> None:
    """Twenty-four moments of a cycle, an odometry period and a pattern; gone for no time, and for longer than any."""
    worst_stop_s = worst_echo_s = 0.0
    for k, reboot_s in enumerate(PHASES):
        run = Run(reboot_s, DOWN[k % len(DOWN)])
        boot_id = run.robot.boot_id
        stopped_s = run.go_through_the_reboot()
        assert run.robot.boot_id != boot_id
        identity = run.driver.identity
        assert identity is not None
        assert identity.boot_id == run.robot.boot_id, "the new boot_id was read"
        worst_stop_s = max(worst_stop_s, stopped_s)
        assert run.state.mode.reason is not None
        assert "re-arm" in run.state.mode.reason or "restored" in run.state.mode.reason

        # The map is empty at that moment, and clock and odometry begin again.
        assert not run.state.perception.objects()
        assert run.state.perception.counts.segments == 0
        seen_s, before = run.run_s, len(run.firings)
        run.until(lambda: len(run.firings) > before, 1.0)  # noqa: B023 - called within the turn
        worst_echo_s = max(worst_echo_s, run.run_s - seen_s)
        assert run.driver.state is LineState.READY, "the pattern was sent again"

        # It stands until it is armed, however long that takes.
        run.until(lambda: run.run_s >= run.reboot_s + run.down_s + 3.0, 9.0)  # noqa: B023
        assert run.mode is Mode.SAFE_STOP
        late = [t for t in run.truths if t.emulated_s > reboot_s + STANDS_WITHIN_S]
        assert late
        assert all(truth.twist.v == 0.0 and truth.twist.w == 0.0 for truth in late)
        new = run.firings[before:]
        assert 0.0 <= new[0].robot_s < 2.0, "the robot's new clock"
        assert all(b.robot_s > a.robot_s for a, b in itertools.pairwise(new))
        assert max(math.hypot(f.pose.x, f.pose.y) for f in new) < 0.2, "the robot's new odometry"

        run.until(lambda: run.mode is Mode.DRIVE, 2.0, Request.ARM)  # noqa: B023
        run.until(lambda: run.robot.truth.twist.v > 0.1, 3.0)  # noqa: B023
    assert worst_stop_s <= STANDS_WITHIN_S / 2.0
    measured(
        f"{len(PHASES)} phases, gone for 0 to {max(DOWN):g} s: SAFE_STOP ≤ {worst_stop_s:.2f} s after it, echoes "
        f"≤ {worst_echo_s:.2f} s after the new boot_id, still until re-armed"
    )


@pytest.mark.parametrize("method", ["paper", "bayes"])
def test_no_jump_in_the_map(method: Literal["paper", "bayes"], measured: Callable[[str], None]) -> None:
    """Objects of the old frame are gone at once; those seen again stand where they are in the new frame."""
    run = Run(12.0, 0.2, method)
    run.go_through_the_reboot()
    origin = run.robot.truth.pose
    assert not run.state.perception.objects()
    run.until(lambda: run.mode is Mode.DRIVE, 3.0, Request.ARM)
    world = run.settings.world
    assert world is not None
    drums = np.array([in_frame_of(origin, (drum.x_m, drum.y_m)) for drum in world.drum])
    worst_ft, seen = 0.0, 0
    give_up_s = run.run_s + 14.0
    while run.run_s < give_up_s:
        run.cycle()
        for found in run.state.perception.objects():
            seen += 1
            error_ft = float(np.hypot(*(drums - (found.x, found.y)).T).min()) / FT
            worst_ft = max(worst_ft, error_ft)
    assert seen > 0
    assert len(run.state.perception.objects()) >= 2
    assert worst_ft < 1.0, "an object of the old frame would be feet away"
    measured(f"{method}: from the reboot on, every object in every cycle within {worst_ft:.2f} ft of a drum")


def test_a_restart_at_the_wrap_of_the_clock_is_detected_by_missing_firings(
    measured: Callable[[str], None],
) -> None:
    """The one moment when the clock shows no restart: just when it would have wrapped anyway."""
    run = Run(3.0, 0.0, clock_start_us=2**32 - 3_000_000)
    run.drive()
    run.until(lambda: run.run_s >= 3.0, 4.0)
    run.until(run.reboot_seen, 1.5)
    assert run.mode is Mode.SAFE_STOP
    assert not run.state.perception.objects()
    seen_s = run.run_s - run.reboot_s
    before = len(run.firings)
    run.until(lambda: len(run.firings) > before, 1.0)
    measured(f"a restart hidden by the clock's wrap: seen after {seen_s:.2f} s")
