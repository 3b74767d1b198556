"""What a ring's blind sides forbid, against the rule by which each cycle drives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviors.surroundings.field_of_view import path_half_angle_rad, seen_speed_m_s
from config.errors import UserError
from config.load import load_settings
from config.robot import SensorConfig
from config.settings import Settings
from config.world import AcousticsConfig, DrumConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from perception.percept import Pose
from runtime.support.blind_sides import _gaps_m, blind_notes, blind_sides_deg, refuse_blind_ways, way_refusal
from runtime.support.pattern_check import oldest_percept


def robot(*angles_deg: float, half_deg: float = 12.0, synchro: bool = False) -> Settings:
    """A robot with sensors on its rim at these bearings."""
    settings = load_settings("hallway", ["ring.firing=single", f"ring.beam_half_angle_deg={half_deg}"])
    sensors = tuple(
        SensorConfig(x_m=0.2 * math.cos(math.radians(a)), y_m=0.2 * math.sin(math.radians(a)), angle_deg=a)
        for a in angles_deg
    )
    ring = settings.ring.model_copy(update={"sensors": sensors, "count": None, "radius_m": None})
    body = settings.body.model_copy(update={"synchro": synchro})
    return settings.model_copy(update={"ring": ring, "body": body})


def test_a_ring_that_looks_all_round_has_no_blind_side() -> None:
    assert blind_notes(robot(*np.arange(0.0, 360.0, 20.0).tolist())) == []


@pytest.mark.parametrize("half_deg", [12.0, 16.0])
def test_beams_that_end_side_by_side_leave_a_strip_in_which_a_mirroring_drum_is_not_heard(half_deg: float) -> None:
    settings = robot(*np.arange(0.0, 360.0, 24.0).tolist(), half_deg=half_deg)
    heard = False
    for range_m in np.linspace(0.6, 2.0, 8).tolist():
        x, y = range_m * math.cos(math.radians(12.0)), range_m * math.sin(math.radians(12.0))
        scene = compile_scene(WorldConfig(drum=(DrumConfig(x_m=x, y_m=y, radius_m=0.2),)))
        sonar = Sonar(settings.ring, scene, AcousticsConfig(model="specular"), np.random.default_rng(0))
        heard |= bool(np.isfinite(sonar.fire(Pose(0.0, 0.0, 0.0), 0.0, range(15))).any())
    notes = blind_notes(settings)
    assert heard == (half_deg > 12.0)
    assert [note for note in notes if "strip" in note] == ([] if heard else notes)
    if not heard:
        chord_m = 2.0 * 0.2 * math.sin(math.radians(12.0))
        assert f"a strip {chord_m:.2f} m wide between them, at any range" in notes[0]
        assert "beams of ±15°" in notes[0]


def test_of_strips_that_never_end_the_widest_is_named() -> None:
    settings = robot(-36.0, -12.0, 12.0, 36.0, half_deg=12.0)
    right, *others = settings.ring.sensors or ()
    sensors = (right.model_copy(update={"y_m": right.y_m - 0.1, "x_m": right.x_m - 0.05}), *others)
    wide = settings.model_copy(update={"ring": settings.ring.model_copy(update={"sensors": sensors})})
    widths = [[width for width, _ in _gaps_m(one, math.radians(12.0))] for one in (settings, wide)]
    assert max(widths[1]) > max(widths[0]) + 0.01
    assert f"a strip {max(widths[1]):.2f} m wide" in " ".join(blind_notes(wide))


def test_six_sensors_in_front_are_blind_behind_and_do_not_back() -> None:
    settings = robot(-50.0, -30.0, -10.0, 10.0, 30.0, 50.0)
    assert blind_sides_deg(settings) == [(63, 297)]
    sides, back, stand = blind_notes(settings)
    assert "no sensor looks from 63° to 297°" in sides
    assert "the robot never drives backwards" in back
    assert not any("backwards" in note for note in blind_notes(robot(0.0))), "one that never drives has no dead end"
    assert "at one place it hears 125° of 360°" in stand
    assert "does not find itself before it has turned or driven, and it recognises an object once" in stand


def test_a_ring_that_hears_nothing_hears_no_less(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("runtime.support.blind_sides.blind_sides_deg", lambda _settings: [(-180, 180)])
    assert "at one place it hears 0° of 360°" in blind_notes(robot(0.0))[-1]


def test_a_ring_that_hears_more_than_half_of_a_turn_finds_itself_at_a_stand() -> None:
    notes = blind_notes(robot(-90.0, -70.0, -50.0, -30.0, -10.0, 10.0, 30.0, 50.0, 70.0, 90.0))
    assert notes
    assert not any("at one place" in note for note in notes)


@pytest.mark.parametrize(("course_deg", "is_refused"), [(0.0, False), (5.0, False), (30.0, True), (178.0, True)])
def test_a_ring_that_does_not_turn_refuses_what_lies_on_its_blind_side(
    course_deg: float, *, is_refused: bool
) -> None:
    settings = robot(-42.0, -30.0, -10.0, 10.0, 30.0, 42.0, half_deg=20.0, synchro=True)
    why = way_refusal(settings, math.radians(course_deg))
    assert (why is not None) == is_refused
    if why is not None:
        assert f"the goal lies at {course_deg:.0f}° from the ring's front, and the robot drives only at -" in why
    assert "the mission may lead anywhere" in str(way_refusal(settings, None))


def test_a_ring_that_turns_or_looks_all_round_refuses_nothing() -> None:
    for settings in (robot(-30.0, -10.0, 10.0, 30.0), robot(*np.arange(0.0, 360.0, 20.0).tolist(), synchro=True)):
        assert way_refusal(settings, math.pi) is way_refusal(settings, None) is None


def test_a_run_with_a_goal_or_a_mission_to_a_blind_side_is_refused() -> None:
    settings = robot(-42.0, -30.0, -10.0, 10.0, 30.0, 42.0, half_deg=20.0, synchro=True)
    refuse_blind_ways(settings.model_copy(update={"goal": None, "mission": None}))
    goal = load_settings("hallway", ["goal.x_m=-3.0", "goal.y_m=0.1"]).goal
    with pytest.raises(UserError, match="the goal lies at 178°"):
        refuse_blind_ways(settings.model_copy(update={"goal": goal}))
    mission = load_settings("room", mission="wander").mission
    with pytest.raises(UserError, match="the mission may lead anywhere"):
        refuse_blind_ways(settings.model_copy(update={"goal": None, "mission": mission}))
    assert any("leads to a blind" in note for note in blind_notes(settings))


@pytest.mark.parametrize("seed", range(8))
def test_nothing_drives_to_a_side_that_is_called_blind(seed: int) -> None:
    """Over random rings, courses into a blind side have no speed, and those clear of all are not forbidden by age."""
    rng = np.random.default_rng(seed)
    settings = robot(*rng.uniform(0.0, 360.0, rng.integers(1, 9)).tolist(), half_deg=float(rng.uniform(5.0, 25.0)))
    arbiter, sides = settings.behaviors.arbiter, blind_sides_deg(settings)
    path_deg = math.degrees(path_half_angle_rad(settings.body, arbiter.clearance_m))
    for course in range(0, 360, 3):
        percept = replace(oldest_percept(settings, 0.0), pose=Pose(0.0, 0.0, math.radians(course)))
        view = replace(percept.field_of_view, ages_s=np.zeros(len(settings.ring.mounts)))
        speed = seen_speed_m_s(replace(percept, field_of_view=view), settings.body, arbiter.clearance_m)
        gaps = [abs((a - course + 180) % 360 - 180) for begin, end in sides for a in range(begin, end + 1)]
        if min(gaps, default=360) <= path_deg - 1.0:
            assert speed == 0.0
        elif min(gaps, default=360) > path_deg + 1.5:
            assert speed > 0.0
