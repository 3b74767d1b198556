"""Firing patterns with which a robot could not drive are refused, with what would work."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from config.load import list_shipped, load_settings
from config.robot import NO_BODY, FiringConfig, SensorConfig
from drivers.driver import DriverError
from drivers.firing_pattern import FiringError, firing_pattern
from runtime.support.pattern_check import (
    courses_rad,
    crosstalk_note,
    gap_note,
    longest_gaps_s,
    more_looks,
    pattern_speed_m_s,
    refuse_undrivable,
)

pytestmark = pytest.mark.promise("P24")

DATA = Path(__file__).parents[2] / "data"
STOP = "behaviors.move_ahead.at_end=stop"


def problem(*sets: str) -> str:
    """Return why these settings of the hallway are refused."""
    with pytest.raises(FiringError) as refused:
        refuse_undrivable(load_settings("hallway", sets))
    return str(refused.value)


@pytest.mark.parametrize("run", [*list_shipped("runs"), DATA / "corridor.toml", DATA / "ring24.toml"], ids=str)
def test_shipped_runs_and_recorded_rings_drive_at_their_base_velocity(run: str | Path) -> None:
    settings = load_settings(run)
    refuse_undrivable(settings)
    assert pattern_speed_m_s(settings) >= settings.behaviors.arbiter.base_velocity_m_s


PRESETS = {
    "single": 0.102, "opposite_pairs": 0.402, "thirds": 0.502, "quadrants": 0.552, "octets": 0.627,
    "alternating": 0.452,
}  # fmt: skip


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_drives_and_how_fast(preset: str) -> None:
    settings = load_settings("hallway", [f"ring.firing={preset}"])
    refuse_undrivable(settings)
    assert pattern_speed_m_s(settings) == pytest.approx(PRESETS[preset], abs=0.001)


def test_a_pattern_that_comes_round_too_seldom() -> None:
    """24 steps of .1 s, a flight of .045 s and a cycle of .05 s."""
    line = problem("ring.firing={preset='single', step_period_s=0.1}")
    assert line.startswith(
        "ring.firing: a look ahead can be 2.50 s old, and counts for behaviors.avoid_static_obstacle"
    )
    assert line.endswith("echo_age_max_s at least 3.1")
    longer = "behaviors.avoid_static_obstacle.echo_age_max_s=3.1"
    settings = load_settings("hallway", ["ring.firing={preset='single', step_period_s=0.1}", longer])
    refuse_undrivable(settings)
    assert pattern_speed_m_s(settings) >= settings.behaviors.arbiter.base_velocity_m_s
    assert "a look ahead can be 0.25 s old" in problem("behaviors.avoid_static_obstacle.echo_age_max_s=0.25")
    assert "a look ahead can be 1.20 s old" in problem("cycle.rate_hz=1", longer.replace("3.1", "1.2"))


def test_a_pattern_that_looks_backwards() -> None:
    line = problem("ring.firing={sets=[[10, 12, 14], [11, 13]]}")
    assert line == (
        "ring.firing: the pattern does not look ahead, so that the robot could not drive there; add sensors to the "
        "sets: 0, 1, 2, 3, 21, 22, 23"
    )


def test_a_ring_with_a_hole_ahead() -> None:
    """It is good for a stand, a replay, or to turn on the spot: it is named, and the robot does not drive there."""
    settings = load_settings("hallway", ["ring.beam_half_angle_deg=7"])
    refuse_undrivable(settings)
    assert pattern_speed_m_s(settings) == 0.0
    note = gap_note(settings)
    assert note is not None
    assert "no beam covers -38° to -37° and" in note
    assert "it needs 7 in front, 14° apart at most, or 26 all round" in note
    assert gap_note(load_settings("hallway")) is None


def test_a_window_that_ends_within_the_clearance() -> None:
    line = problem("ring.firing.window_m=0.2", "behaviors.arbiter.clearance_m=0.2")
    assert line.startswith("ring.firing: window_m 0.2 ends within behaviors.arbiter.clearance_m 0.2 of the rim")


def test_a_synchro_drive_must_see_along_each_leg_and_others_ahead() -> None:
    """The ring of a synchro drive does not turn with its wheels."""
    front = "ring.firing={sets=[[21, 22, 23, 0, 1, 2, 3]]}"
    assert "does not look along a leg, at 180° from sensor 0's direction" in problem(front)
    assert "at 90° from" in problem(front, STOP, "behaviors.move_ahead.move_ahead_direction_deg=90")
    for sets in ([front, STOP], [front, "body.synchro=false"]):
        refuse_undrivable(load_settings("hallway", sets))
    assert courses_rad(load_settings("hallway")) == pytest.approx((0.0, math.pi))
    assert courses_rad(load_settings("hallway", [STOP])) == (0.0,)


def test_a_robot_file_for_replays_alone_needs_no_firing_pattern() -> None:
    """The usual one fires eight sensors at a time, which three do not divide into."""
    settings = load_settings("hallway", robot="hobby3")
    ring = settings.ring.model_copy(update={"firing": FiringConfig(preset="octets")})
    refuse_undrivable(settings.model_copy(update={"ring": ring, "body": NO_BODY}))
    with pytest.raises(FiringError, match="3 sensors do not divide by 8"):
        refuse_undrivable(settings.model_copy(update={"ring": ring}))


def test_what_the_robot_itself_cannot_do_is_refused_as_before() -> None:
    assert "step_period_s 0.001 is shorter than sound takes" in problem("ring.firing.step_period_s=0.001")
    with pytest.raises(DriverError):
        refuse_undrivable(load_settings("hallway", ["robot.driver=nonesuch"]))


def test_by_what_a_ring_looks_more_often() -> None:
    """With one bearing fewer, 180 degrees by five leave gaps between beams of ±25 degrees; by nine they do not."""
    hobby, servo = load_settings("room", robot="hobby3").ring, load_settings("room", robot="servo1").ring
    faster = "make step_period_s shorter"
    assert more_looks(hobby) == f"fire more sensors at a time, or {faster}"
    assert more_looks(hobby.model_copy(update={"firing": FiringConfig(sets=((0, 1, 2),))})) == faster
    assert more_looks(servo) == f"give the servo fewer bearings, or {faster}"
    for bearings, said in ((5, "a narrower sweep"), (9, "fewer bearings")):
        sensor = SensorConfig(x_m=0.0, y_m=0.0, angle_deg=0.0, servo=True, bearings=bearings, sweep_deg=180.0)
        ring = servo.model_copy(update={"sensors": (sensor,), "beam_half_angle_deg": 25.0})
        assert more_looks(ring) == f"give the servo {said}, or {faster}"


def test_the_longest_gap_of_each_sensor() -> None:
    ring = load_settings("hallway", ["ring.firing={sets=[[0], [1], [0], [2], [2]], step_period_s=0.1}"]).ring
    gaps = longest_gaps_s(firing_pattern(ring), 24)
    np.testing.assert_allclose(gaps[:3], [0.3, 0.5, 0.4])
    assert np.isinf(gaps[3:]).all()


def test_beams_that_just_touch_are_no_gap_of_a_ring_that_has_one() -> None:
    sensors = "[{x_m=0.1, y_m=0.0, angle_deg=0.0}, {x_m=0.1, y_m=0.02, angle_deg=30.0}]"
    note = gap_note(load_settings("hallway", [f"ring.sensors={sensors}"], robot="hobby3"))
    assert note is not None
    assert "no beam covers -180° to -15° (" in note


@pytest.mark.parametrize(("sets", "pairs"), [("[[0, 1], [2]]", "0 and 1"), ("[[0, 2, 1]]", "0 and 1, 1 and 2")])
def test_neighbours_that_fire_together_are_named(sets: str, pairs: str) -> None:
    """By itself ring-test hears it only where a surface returns the other's pulse."""
    note = crosstalk_note(load_settings("hallway", [f"ring.firing={{sets={sets}}}"], robot="hobby3").ring)
    assert note is not None
    assert f"sensors {pairs} fire together and look less than 45° apart" in note
    assert crosstalk_note(load_settings("hallway", ["ring.firing={sets=[[0, 2], [1]]}"], robot="hobby3").ring) is None
