"""Whether a ring repeats old readings: what a wall along the path, a turn and a way explain."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.records import Records, records, zeros
from perception.ring_faults.memory import EVIDENCE_NAT, NO_ECHO_M, EchoTrace, RingTrace, mark
from perception.ring_faults.repeats import (
    EQUAL_NAT,
    EQUAL_PRIOR,
    NOISY_NAT,
    REPEAT_NAT,
    REPEATS_MAX,
    SENSOR_NAT,
    STEP_MIN_M,
    WINDING_NAT,
    changes_due,
    is_parallel_wall,
    learn_noise,
    repeat_evidence,
    repeats,
    weigh_repeat,
)

MOUNTS = np.array([[0.0, 0.0, math.radians(15.0 * k)] for k in range(24)])
HALF = math.radians(12.0)
TOLERANCE = 0.005
RECEPTION = (HALF, TOLERANCE, 5.0)


def heard(*ranges: tuple[int, float]) -> Records[EchoTrace]:
    """Return a memory in which sensors, by number, have repeated a range since the ring was at the origin."""
    echoes = records(EchoTrace, zeros(EchoTrace, 24))
    for k, r in ranges:
        echoes[k].is_known, echoes[k].latest.range_m, echoes[k].agreed_m = 1, r, r
        mark(echoes[k].repeated, r, 0.0, 0.0, MOUNTS[k, 2], 0.0)
    return echoes


def due(echoes: Records[EchoTrace], i: int, x: float, turned: float = 0.0) -> float:
    axis = MOUNTS[i, 2] + turned
    return changes_due(i, (0.0, x, 0.0, axis), echoes[i].repeated, turned, MOUNTS, RECEPTION, echoes, x)


@pytest.mark.parametrize("side", [1, -1])
def test_a_rough_wall_beside_the_path_explains_what_sensors_hear_of_it(side: int) -> None:
    square, oblique = 6 * side % 24, 3 * side % 24
    at_edge = 1.2 / math.sin(math.radians(57.0))
    echoes = heard((square, 1.2), (oblique, at_edge))
    for r, explained in ((at_edge, True), (0.7, False), (2.5, False)):
        found = is_parallel_wall(oblique, r, (0.3, 0.0), 0.0, MOUNTS, RECEPTION, 0.01, echoes, 0.3)
        assert bool(found) is explained
    echoes = heard((oblique, at_edge))
    assert not is_parallel_wall(oblique, at_edge, (0.3, 0.0), 0.0, MOUNTS, RECEPTION, 0.01, echoes, 0.3)


@pytest.mark.parametrize("lean", [0.2, -0.2])
def test_a_wall_that_leans_is_farther_or_nearer_from_a_sensor_ahead(lean: float) -> None:
    """The one square to the path is 0.4 m behind; the beam's edge at 57° meets the wall at another angle."""
    mounts = np.array([[-0.2, 0.0, math.radians(90.0)], [0.2, 0.0, math.radians(45.0)]])
    echoes = heard((0, 1.0))
    r = (1.0 + 0.4 * math.sin(lean)) / math.sin(math.radians(57.0) - lean)
    for most, explained in ((0.21, True), (0.1, False)):
        found = is_parallel_wall(1, r, (0.3, 0.0), 0.0, mounts, RECEPTION, most, echoes[:2], 0.3)
        assert bool(found) is explained


def test_a_sensor_that_looks_ahead_should_change_with_the_way() -> None:
    echoes = heard((0, 2.0))
    assert [due(echoes, 0, x) for x in (0.05, 0.07, 0.13, 1.0)] == [0.0, 1.0, 2.0, 16.0]
    assert due(heard((6, 2.0)), 6, 1.0) == 0.0, "what is beside the path does not come nearer"


def test_no_mirror_that_both_looks_can_hear_changes_less_than_is_due() -> None:
    """Random motions, and mirrors whose normals lie in the beam before and after."""
    rng, most = np.random.default_rng(7), 0.0
    for _ in range(2000):
        turned, way = float(rng.uniform(-2.0 * HALF, 2.0 * HALF)), float(rng.uniform(0.05, 1.5))
        course = float(rng.uniform(-math.pi, math.pi))
        echoes = heard((0, 1.0))
        look = (1.0, way * math.cos(course), way * math.sin(course), turned)
        times = changes_due(0, look, echoes[0].repeated, turned, MOUNTS, RECEPTION, echoes, way)
        normal = float(rng.uniform(max(0.0, turned) - HALF, min(0.0, turned) + HALF))
        assert abs(way * math.cos(normal - course)) >= times * STEP_MIN_M
        most = max(most, times)
    assert most > 10.0


def test_a_wall_along_the_path_explains_no_range_that_the_turn_should_have_changed() -> None:
    """A robot that turned towards a wall, and drives at it with its old ranges."""
    square, oblique = 6, 8
    echoes = heard((square, 0.8), (oblique, 0.82))
    for sensor, turned, is_explained in ((square, 0.0, True), (oblique, 0.0, True), (oblique, 0.35, False)):
        course = MOUNTS[square, 2] - 0.5 * math.pi if turned == 0.0 else turned + MOUNTS[square, 2] - 0.5 * math.pi
        look = (echoes[sensor].latest.range_m, math.cos(course), math.sin(course), MOUNTS[sensor, 2] + turned)
        times = changes_due(sensor, look, echoes[sensor].repeated, turned, MOUNTS, RECEPTION, echoes, 1.0)
        assert (times == 0.0) is is_explained


@pytest.mark.parametrize(("turned_deg", "times"), [(20.0, 0.0), (30.0, 1.0), (-75.0, 3.0), (150.0, 6.0)])
def test_a_sensor_should_change_once_for_each_width_of_its_beam_that_it_turns(
    turned_deg: float, times: float
) -> None:
    assert due(heard((0, 2.0)), 0, 0.0, math.radians(turned_deg)) == times


def test_readings_with_a_little_noise_repeat_each_other() -> None:
    assert repeats(2.0, 2.004)
    assert not repeats(2.0, 2.02)
    assert repeats(NO_ECHO_M, NO_ECHO_M)
    assert not repeats(0.001, NO_ECHO_M)


def test_a_change_ahead_ends_the_evidence_and_one_behind_only_its_own() -> None:
    echoes, ring = heard(), records(RingTrace, zeros(RingTrace, 1))
    ring[0].standstill = 1

    def fire(i: int, r: float, x: float) -> None:
        axis = MOUNTS[i, 2]
        mark(echoes[i].before, echoes[i].latest.range_m, x, 0.0, axis, x)
        mark(echoes[i].latest, r, x, 0.0, axis, x)
        weigh_repeat(i, (r, x, 0.0, axis), 0.0, i != 12, MOUNTS, RECEPTION, echoes, ring)

    for x in (0.0, 0.01, 0.08):
        fire(0, 2.0, x)
        fire(12, 3.0, x)
        fire(6, NO_ECHO_M, x)
    assert ring[0].repeated_nat == pytest.approx(2.0 * REPEAT_NAT)
    fire(12, 3.1, 0.08)
    assert ring[0].repeated_nat == pytest.approx(REPEAT_NAT)
    fire(0, 1.9, 0.08)
    assert ring[0].repeated_nat == 0.0


@pytest.mark.parametrize("is_due", [False, True])
def test_walls_along_the_path_do_not_explain_readings_without_noise_besides_one_that_was_due(is_due: bool) -> None:
    echoes, ring = heard(), records(RingTrace, zeros(RingTrace, 1))
    all_of = ring[0]
    all_of.standstill = 1
    sides = (5, 6, 7, 17, 18, 19)
    for k in range(40):
        x = 0.05 * k
        for i in (*sides, 12):
            r = 0.7 / math.sin(MOUNTS[5, 2] + HALF) if i in sides else 3.0
            if i == 12 and not is_due:
                r += x
            axis = MOUNTS[i, 2]
            mark(echoes[i].before, echoes[i].latest.range_m, x - 0.05, 0.0, axis, x - 0.05)
            mark(echoes[i].latest, r, x, 0.0, axis, x)
            echoes[i].agreed_m, echoes[i].agreed_path_m = r, x
            weigh_repeat(i, (r, x, 0.0, axis), 0.0, i != 12, MOUNTS, RECEPTION, echoes, ring)
    equal = -math.log(EQUAL_PRIOR)
    assert all_of.repeated_nat == pytest.approx(is_due * REPEATS_MAX * REPEAT_NAT)
    assert repeat_evidence(all_of) == pytest.approx(all_of.repeated_nat + equal, abs=0.1)
    assert (repeat_evidence(all_of) > EVIDENCE_NAT) is is_due


def test_a_robot_that_turns_as_it_drives_keeps_its_distance_from_nothing() -> None:
    echoes, ring = heard((6, 0.5)), records(RingTrace, zeros(RingTrace, 1))
    c, all_of = echoes[6], ring[0]
    c.standstill = all_of.standstill = 1

    def evidence(r: float, moved: float, turned: float, tolerance: float = TOLERANCE) -> float:
        before, axis = c.stuck_nat, math.pi - 0.01 + turned - math.tau
        mark(c.before, 0.5, 0.0, 0.0, math.pi - 0.01, 0.0)
        for place in (c.own, c.repeated):
            mark(place, 0.5, 0.0, 0.0, axis, 0.0)
        mark(c.latest, r, moved, 0.0, axis, moved)
        reception = (HALF, tolerance, 5.0)
        is_ahead = True
        weigh_repeat(6, (r, moved, 0.0, axis), 0.0, is_ahead, MOUNTS, reception, echoes, ring)
        return float(c.stuck_nat - before)

    assert evidence(0.5, 0.04, 0.2) == evidence(0.5, 0.04, -0.2) == pytest.approx(WINDING_NAT)
    assert evidence(0.502, 0.04, 0.2) == 0.0, "a little noise"
    assert evidence(0.5, 0.01, 0.2) == 0.0, "one that turns on the spot hears the same while its beam is wide enough"
    assert evidence(0.5, 0.05, 0.01) == 0.0, "one that drives straight on may drive along a wall"
    assert evidence(0.5, 0.04, 1.0, 0.033) == 0.0, "coarse steps hide a small change"


def test_noise_is_learned_at_a_standstill_from_changes_that_noise_explains() -> None:
    echoes, ring = heard((0, 2.0)), records(RingTrace, zeros(RingTrace, 1))
    c, all_of = echoes[0], ring[0]

    def look(r: float, x: float = 0.0) -> float:
        c.is_compared = 1
        mark(c.before, c.latest.range_m, c.latest.x, c.latest.y, c.latest.axis, 0.0)
        mark(c.latest, r, x, 0.0, 0.0, 0.0)
        learn_noise(c, r, x, 0.0, 0.0, TOLERANCE, all_of)
        return float(all_of.noise_nat)

    assert look(2.01) == pytest.approx(NOISY_NAT)
    assert look(2.01) == look(2.013, 0.0) + -EQUAL_NAT
    known = look(2.013)
    for r, x in ((3.0, 0.0), (NO_ECHO_M, 0.0), (3.0, 0.0), (3.01, 0.1)):
        assert look(r, x) == pytest.approx(known), "a leap, silence and a reading after a way say nothing"
    for k in range(9):
        look(3.0 + 0.01 * (k % 2), 0.1)
    assert all_of.noise_nat == SENSOR_NAT
    assert look(3.0, 0.1) == look(3.0, 0.1) == SENSOR_NAT, "a ring that is frozen had noise"
    all_of.equal_nat = EVIDENCE_NAT + 1.0
    assert repeat_evidence(all_of) > EVIDENCE_NAT
