"""The emulated ring's schedule: its minimum spacing holds, whatever happens to the line."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from config.robot import SOUND_SPEED_M_S, FiringConfig, RingConfig
from drivers.denning.frames import TENTH_FT_M, Pattern
from drivers.denning.pattern_rotation import Rotation
from drivers.denning.wire_units import wire_pattern
from tests.drivers.cable import STEP_S, Cable


def patterns(rng: np.random.Generator) -> list[Pattern]:
    """What hosts with all kinds of robot files send, and what stops the ring."""
    found = [Pattern(0, 50, 255, ())]
    for _ in range(20):
        window_m = float(rng.uniform(0.16, 7.77))
        shortest_s = 2.0 * window_m / SOUND_SPEED_M_S
        step_s = max(0.001, shortest_s * float(rng.choice([1.0, 1.0, 1.3, 4.0])) + 1e-6)
        sets = tuple(tuple(rng.choice(24, rng.integers(1, 9), replace=False).tolist()) for _ in range(3))
        ring = RingConfig(
            count=24, radius_m=0.381, beam_half_angle_deg=12.0, resolution_m=0.03048, range_min_m=0.1524,
            range_max_m=7.7724, firing=FiringConfig(sets=sets, rotations=2, step_period_s=step_s, window_m=window_m),
        )  # fmt: skip
        found.append(Pattern(0, *wire_pattern(ring)))
    return found


@pytest.mark.parametrize("firings", [50_000, pytest.param(1_000_000, marks=pytest.mark.soak)])
def test_no_reconnect_shortens_a_step(firings: int, measured: Callable[[str], None]) -> None:
    """Each reconnect sets a pattern, the same or another, at any moment; none fires into another's window."""
    rng = np.random.default_rng(11)
    known = patterns(rng)
    rotation, now_us, fired, reconnects, tightest = Rotation(), 0, 0, 0, math.inf
    start_us, closes_us, step_us = -(10**9), 0, 0
    current = known[1]
    while fired < firings:
        # A line is lost and found again after a few steps, or while the first one is still under way.
        if rng.random() < 0.7:
            current = known[int(rng.integers(0, len(known)))]
        rotation.set_pattern(current, now_us)
        reconnects += 1
        until_us = now_us + int(rng.exponential(30.0) * 50_000)
        while rotation.next_us is not None and rotation.next_us <= until_us:
            now_us = max(now_us, rotation.next_us)
            step = rotation.step(now_us)
            if step is None:
                break
            fired += 1
            assert step.at_us >= closes_us, "it fires while the last one still listens"
            assert step.at_us - start_us >= step_us, "a step was cut short"
            if step.at_us - start_us < 10**8:
                tightest = min(tightest, (step.at_us - start_us) / max(1, step_us))
            start_us, closes_us = step.at_us, step.closes_us
            flight_s = 2.0 * step.window_m / SOUND_SPEED_M_S
            assert closes_us - start_us >= 1e6 * flight_s
            # Which pattern this step belongs to: a new one takes effect here, and not before.
            step_us = (rotation.next_us or until_us) - step.at_us if rotation.next_us is not None else 0
        now_us = until_us
    measured(f"{fired:,} firings, {reconnects:,} reconnects: never closer than {tightest:.2f} of a step")


@pytest.mark.compiled
def test_the_schedule_holds_through_a_real_conversation() -> None:
    """The same with the whole driver and robot, the line unplugged every few steps."""
    cable, rng = Cable(), np.random.default_rng(12)
    needed_s = 2.0 * 255 * TENTH_FT_M / SOUND_SPEED_M_S
    for _ in range(50):
        cable.plug()
        cable.run(float(rng.uniform(STEP_S, 0.6)))
        cable.unplug()
        cable.run(float(rng.uniform(STEP_S, 0.2)))
    times = np.array([firing.robot_s for firing in cable.firings])
    assert len(times) > 70
    assert np.diff(times).min() >= max(needed_s, 0.05) - 1e-6
    steps = np.diff(times) / 0.05
    assert np.allclose(steps, np.round(steps), atol=1e-3), "the rotation keeps its beat through every reconnect"


def test_setting_a_pattern_again_does_not_speed_up_the_ring() -> None:
    pattern = Pattern(0, 50, 255, (1, 2, 4))
    rotation, times = Rotation(), []
    for now_us in range(0, 2_000_000, 1000):
        if now_us % 7000 == 0:
            rotation.set_pattern(replace(pattern, seq=now_us // 7000 % 256), now_us)
        step = rotation.step(now_us)
        if step is not None:
            times.append(step.at_us)
    assert np.diff(times).tolist() == [50_000] * (len(times) - 1)
    assert len(times) == 40
