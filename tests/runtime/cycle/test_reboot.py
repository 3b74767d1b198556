"""P7: a restart of the robot is detected at any moment of a run: it stands until re-armed, with an empty map."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from drivers.driver import LineState
from drivers.emulator.faults import Reboot
from drivers.messages import Pose
from runtime.cycle.inputs import Request
from runtime.cycle.modes import Mode
from tests.runtime.emulated_run import FT, Run, hallway

pytestmark = [pytest.mark.compiled, pytest.mark.promise("P7")]

STANDS_WITHIN_S = 1.0
"""The deadman's half second is over by then, and the ramp."""


def reboot_seen(run: Run) -> bool:
    return run.records[-1].inputs.received.rebooted


def drive(run: Run) -> None:
    run.until_true(lambda: run.mode is Mode.READY, 2.0)
    run.until_true(lambda: run.mode is Mode.DRIVE, 2.0, Request.ARM)


def run_that_reboots(reboot_s: float, down_s: float, method: str = "paper", clock_start_us: int = 0) -> Run:
    fault = Reboot(kind="reboot", at_s=reboot_s, duration_s=down_s)
    return hallway(7, fault, method=method, arms=False, clock_start_us=clock_start_us)


def go_through_the_reboot(run: Run, reboot_s: float, down_s: float) -> float:
    """Continue through the reboot, unarmed; return after how long the program stood in SAFE_STOP, s."""
    run.until(reboot_s)
    run.until_true(lambda: run.mode is Mode.SAFE_STOP, 2.0)
    stopped_s = run.run_s - reboot_s
    if not any(record.inputs.received.rebooted for record in run.records):
        run.until_true(lambda: reboot_seen(run), down_s + 2.0)
    return stopped_s


def in_frame_of(origin: Pose, place: tuple[float, float]) -> tuple[float, float]:
    seen = origin.inverse().compose(Pose(*place, 0.0))
    return seen.x, seen.y


PHASE_S = 0.3014
"""The reboots are spread over this, s: over cycles (0.05), odometry periods (0.02) and most of a pattern (0.4)."""
DOWN = (0.0, 0.05, 0.3, 1.3)


def boot_id_of(run: Run) -> int:
    identity = run.driver.identity
    assert identity is not None
    return identity.boot_id


def reboot_in_phase(reboot_s: float, down_s: float) -> tuple[float, float]:
    """Check a run through a reboot; return the times until SAFE_STOP and from the new boot_id to an echo, s."""
    run = run_that_reboots(reboot_s, down_s)
    drive(run)
    boot_id = boot_id_of(run)
    stopped_s = go_through_the_reboot(run, reboot_s, down_s)
    assert boot_id_of(run) != boot_id, "the new boot_id was read"
    assert run.state.mode.reason is not None
    assert "re-arm" in run.state.mode.reason or "restored" in run.state.mode.reason

    # The map is empty at that moment, and clock and odometry begin again.
    assert not run.state.perception.objects()
    assert run.state.perception.counts.segments == 0
    seen_s, before = run.run_s, len(run.firings)
    run.until_true(lambda: len(run.firings) > before, 1.0)
    echo_s = run.run_s - seen_s
    assert run.driver.state is LineState.READY, "the pattern was sent again"

    # It stands until it is armed, however long that takes.
    run.until(max(run.run_s, reboot_s + down_s + 3.0))
    assert run.mode is Mode.SAFE_STOP
    late = [t for t in run.truths if t.emulated_s > reboot_s + STANDS_WITHIN_S]
    assert late
    assert all(truth.twist.v == 0.0 and truth.twist.w == 0.0 for truth in late)
    new = run.firings[before:]
    assert 0.0 <= new[0].robot_s < 2.0, "the robot's new clock"
    assert all(b.robot_s > a.robot_s for a, b in itertools.pairwise(new))
    assert max(math.hypot(f.pose.x, f.pose.y) for f in new) < 0.2, "the robot's new odometry"

    run.until_true(lambda: run.mode is Mode.DRIVE, 2.0, Request.ARM)
    run.until_true(lambda: run.robot.truth.twist.v > 0.1, 3.0)
    return stopped_s, echo_s


@pytest.mark.parametrize("phases", [4, pytest.param(12, marks=pytest.mark.soak)])
def test_after_a_reboot_in_any_phase_it_stands_until_re_armed(
    phases: int, measured: Callable[[str], None]
) -> None:  # fmt: skip
    """The robot is off for no time, and for longer than any timeout."""
    moments = [2.0 + PHASE_S * k / (phases - 1) for k in range(phases)]
    rows = [reboot_in_phase(reboot_s, DOWN[k % len(DOWN)]) for k, reboot_s in enumerate(moments)]
    worst_stop_s, worst_echo_s = (max(column) for column in zip(*rows, strict=True))
    assert worst_stop_s <= STANDS_WITHIN_S / 2.0
    measured(
        f"{phases} phases, gone for 0 to {max(DOWN):g} s: SAFE_STOP ≤ {worst_stop_s:.2f} s after it, echoes "
        f"≤ {worst_echo_s:.2f} s after the new boot_id, still until re-armed"
    )


@pytest.mark.parametrize("method", [pytest.param("paper", marks=pytest.mark.soak), "bayes"])
def test_no_jump_in_the_map(method: str, measured: Callable[[str], None]) -> None:
    """Objects of the old frame are gone at once; those seen again stand where they are in the new frame."""
    run = run_that_reboots(12.0, 0.2, method)
    drive(run)
    go_through_the_reboot(run, 12.0, 0.2)
    origin = run.robot.truth.pose
    assert not run.state.perception.objects()
    run.until_true(lambda: run.mode is Mode.DRIVE, 3.0, Request.ARM)
    world = run.settings.world
    assert world is not None
    drums = np.array([in_frame_of(origin, (drum.x_m, drum.y_m)) for drum in world.drum])
    worst_ft, seen, end_s = 0.0, 0, run.run_s + 14.0
    while run.run_s < end_s:
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
    """The clock shows no restart at the moment when it would have wrapped anyway."""
    run = run_that_reboots(3.0, 0.0, clock_start_us=2**32 - 3_000_000)
    drive(run)
    run.until(3.0)
    run.until_true(lambda: reboot_seen(run), 1.5)
    assert run.mode is Mode.SAFE_STOP
    assert not run.state.perception.objects()
    seen_s = run.run_s - 3.0
    before = len(run.firings)
    run.until_true(lambda: len(run.firings) > before, 1.0)
    measured(f"a restart hidden by the clock's wrap: seen after {seen_s:.2f} s")
