"""Whether a robot with its firing pattern sees where it drives.

A pattern is judged by the same rule as each cycle (`behaviors.surroundings.field_of_view`), with the oldest looks
that it ever leaves: those of sensors that are just about to report again.
"""

from __future__ import annotations

import math
from itertools import combinations, pairwise
from typing import Final

import numpy as np

from behaviors.surroundings.field_of_view import (
    ROUNDING_RAD,
    listed,
    oldest_look_s,
    path_half_angle_rad,
    seen_speed_m_s,
    unseen_way,
)
from config.robot import BY_HAND_MAX, NO_BODY, RingConfig
from config.settings import Settings
from drivers.firing_pattern import (
    LISTENING_LOBE,
    FiringError,
    FiringPattern,
    firing_pattern,
    sensor_masks,
    sensors,
    time_of_flight_s,
)
from drivers.registry import make_driver
from perception.percept import FieldOfView, Floats, Percept, Pose
from perception.sensor_mounts import mounts_array, reach_m

CRAWL_SHARE: Final = 0.1
"""Least share of the base velocity that a pattern must allow; a robot that is slower stands more than it drives."""
PAIRS_NAMED_MAX: Final = 4


def refuse_undrivable(settings: Settings) -> None:
    """Raise an error if the robot cannot carry out its firing pattern, or could not see where it drives.

    Raises
    ------
    drivers.driver.DriverError
        The robot's driver is not available.
    drivers.firing_pattern.FiringError
        The robot cannot fire so; or the pattern leaves out sensors that look along the way, looks there too seldom
        for the age limit, or listens no farther than the clearance.
    """
    if settings.body == NO_BODY:  # a run refuses it, and nothing else drives or fires
        return
    make_driver(settings)
    arbiter, body = settings.behaviors.arbiter, settings.body
    age_path = "behaviors.avoid_static_obstacle.echo_age_max_s"
    for course in courses_rad(settings):
        percept = oldest_percept(settings, course)
        if seen_speed_m_s(percept, body, arbiter.clearance_m) >= CRAWL_SHARE * arbiter.base_velocity_m_s:
            continue
        view = percept.field_of_view
        oldest_s = oldest_look_s(view, course, path_half_angle_rad(body, arbiter.clearance_m))
        where = "ahead" if course == 0.0 else f"along a leg, at {math.degrees(course):.0f}° from sensor 0's direction"
        if not math.isfinite(oldest_s):
            unseen = unseen_way(percept, course, body, arbiter.clearance_m)
            left_out = [] if unseen is None else [i for i in unseen.sensors if math.isinf(view.sensor_ages_s[i])]
            if not left_out:  # `gap_note` says what it can do
                continue
            raise FiringError(
                f"ring.firing: the pattern does not look {where}, so that the robot could not drive there; add "
                f"sensors to the sets: {listed(left_out)}"
            )
        if view.reach_m <= body.radius_m + arbiter.clearance_m:
            raise FiringError(
                f"ring.firing: window_m {settings.ring.window_m:g} ends within behaviors.arbiter.clearance_m "
                f"{arbiter.clearance_m:g} of the rim, so that the robot could not drive; make it larger"
            )
        enough_s = math.ceil(10.0 * (oldest_s + arbiter.base_velocity_m_s / body.acceleration_max_m_s2)) / 10.0
        raise FiringError(
            f"ring.firing: a look {where} can be {oldest_s:.2f} s old, and counts for {age_path} "
            f"{view.age_max_s:g} s, so that the robot could not drive; {more_looks(settings.ring)}, or make "
            f"{age_path} at least {enough_s:g}"
        )


def more_looks(ring: RingConfig) -> str:
    """Return by which changes of its firing pattern a ring looks in each direction more often."""
    faster = "make step_period_s shorter"
    if not ring.has_servo:
        is_all = firing_pattern(ring).set_size == ring.sensor_count
        return faster if is_all else f"fire more sensors at a time, or {faster}"
    beam_deg = 2.0 * ring.beam_half_angle_deg
    on_servo = (sensor for sensor in ring.sensors or () if sensor.servo)
    # With one bearing fewer, the beams must still meet.
    are_dense = all(one.sweep_deg <= beam_deg * (one.bearings - (1 if one.is_endless else 2)) for one in on_servo)
    return f"give the servo {'fewer bearings' if are_dense else 'a narrower sweep'}, or {faster}"


def pattern_speed_m_s(settings: Settings, missed: int = 0) -> float:
    """Return the speed that the firing pattern allows on every leg, at its oldest looks, m/s.

    Parameters
    ----------
    settings
        The robot and its settings.
    missed
        Readings in a row of each sensor that failed.
    """
    clearance_m = settings.behaviors.arbiter.clearance_m
    courses = courses_rad(settings)
    return min(seen_speed_m_s(oldest_percept(settings, c, missed), settings.body, clearance_m) for c in courses)


def courses_rad(settings: Settings) -> tuple[float, ...]:
    """Return the directions in the ring's frame in which the robot must see, rad.

    Where the ring turns with the wheels, that is ahead. On a synchro drive it does not: there each leg has its own.
    """
    ahead = settings.behaviors.move_ahead
    if not settings.body.synchro:
        return (0.0,)
    out = math.radians(ahead.move_ahead_direction_deg)
    return (out, out + math.pi) if ahead.distance_m is not None and ahead.at_end == "turn_back" else (out,)


def gap_note(settings: Settings) -> str | None:
    """Return which gaps between beams lie in the robot's path, and what that costs; None where there are none."""
    for course in courses_rad(settings):
        half_angle = path_half_angle_rad(settings.body, settings.behaviors.arbiter.clearance_m)
        if not math.isfinite(oldest_look_s(oldest_percept(settings, course).field_of_view, course, half_angle)):
            return _gap_note(settings, course)
    return None


def _gap_note(settings: Settings, course_rad: float) -> str:
    """Return the text for a course that has a gap."""
    view = oldest_percept(settings, 0.0).field_of_view
    axes = np.sort(np.degrees(view.axes_rad[np.isfinite(view.sensor_ages_s)] - course_rad + math.pi) % 360.0) - 180.0
    beam_deg = math.degrees(view.half_angle_rad)
    path_deg = math.degrees(path_half_angle_rad(settings.body, settings.behaviors.arbiter.clearance_m))
    ends = zip([-180.0 - beam_deg, *axes], [*axes, 180.0 + beam_deg], strict=True)
    shift, where = math.degrees(course_rad), "ahead" if course_rad == 0.0 else "along that leg"
    gaps = [
        f"{begin + beam_deg + shift:.0f}° to {end - beam_deg + shift:.0f}°"
        for begin, end in ends
        if end - begin > 2.0 * beam_deg + 1e-6 and begin + beam_deg < path_deg and end - beam_deg > -path_deg
    ]
    return (
        f"ring: no beam covers {' and '.join(gaps)} (counter-clockwise from the ring's front), and the path needs "
        f"every direction within {path_deg:.0f}° of the way, so the robot turns, but never drives {where}; "
        f"{ring_that_drives(beam_deg, path_deg)}, or correct ring.beam_half_angle_deg or body.radius_m"
    )


def crosstalk_note(ring: RingConfig) -> str | None:
    """Return which sensors that fire together look so nearly the same way that one hears the other's pulse, or None.

    Of a wall far away the pulse leaves in the direction in which it returns: within the beam of the one, and within
    `LISTENING_LOBE` of the other's.
    """
    if ring.has_servo or ring.sensor_count > BY_HAND_MAX:
        return None
    apart_rad = (1.0 + LISTENING_LOBE) * math.radians(ring.beam_half_angle_deg)
    axes = [mount.angle_rad for mount in ring.mounts]
    pairs = sorted(
        {
            (first, second)
            for mask in sensor_masks(ring)
            for first, second in combinations(sensors(mask), 2)
            if abs(math.remainder(axes[first] - axes[second], math.tau)) < apart_rad - ROUNDING_RAD
        }
    )
    if not pairs:
        return None
    shown = ", ".join(f"{first} and {second}" for first, second in pairs[:PAIRS_NAMED_MAX])
    more = " …" if len(pairs) > PAIRS_NAMED_MAX else ""
    return (
        f"ring.firing: sensors {shown}{more} fire together and look less than {math.degrees(apart_rad):.0f}° apart, "
        "so that one hears the other's pulse as an echo that is too short (crosstalk): put them into different sets, "
        'or fire one at a time, preset = "single"; `echolocate ring-test` measures it'
    )


def ring_that_drives(beam_deg: float, path_deg: float) -> str:
    """Return which sensors look along the whole path: the fewest in front, and all round.

    Parameters
    ----------
    beam_deg
        Half the width of a beam, degrees.
    path_deg
        The path's directions, to either side of the way, degrees.
    """
    count = max(1, math.ceil(path_deg / beam_deg - 1e-6))
    apart_deg = math.floor(2.0 * beam_deg + 1e-6)
    in_front = "one ahead" if count == 1 else f"{count} in front, {apart_deg}° apart at most"
    all_round = math.ceil(180.0 / beam_deg - 1e-6)
    return f"of sensors with a beam of ±{beam_deg:g}° it needs {in_front}, or {all_round} all round"


def oldest_percept(settings: Settings, course_rad: float, missed: int = 0) -> Percept:
    """Return what a robot in the open sees when every sensor's look is as old as the pattern lets it become.

    An echo arrives when its window has closed, and waits for a cycle at most.

    Parameters
    ----------
    settings
        The robot and its settings.
    course_rad
        Its heading in the ring's frame.
    missed
        Readings in a row of each sensor that failed.
    """
    ring = settings.ring
    pattern, mounts = firing_pattern(ring), mounts_array(ring.mounts)
    late_s = time_of_flight_s(pattern.window_m) + 1.0 / settings.cycle.rate_hz
    axes, ages_s = mounts[:, 2].copy(), (1 + missed) * longest_gaps_s(pattern, len(mounts)) + late_s
    axes[list(ring.turning)] += course_rad
    view = FieldOfView(
        axes,
        ages_s,
        axes,
        ages_s,
        math.radians(ring.beam_half_angle_deg),
        reach_m(ring),
        settings.behaviors.avoid_static_obstacle.echo_age_max_s,
    )
    return Percept(Pose(0.0, 0.0, course_rad), np.empty((0, 2)), view)


def longest_gaps_s(pattern: FiringPattern, count: int) -> Floats:
    """Return the longest time between two firings of each sensor, shape (count,), s; infinite where none fires."""
    steps: list[list[int]] = [[] for _ in range(count)]
    for step, mask in enumerate(pattern.masks):
        for sensor in sensors(mask):
            steps[sensor].append(step)
    around = len(pattern.masks)
    # Without numpy, whose call takes longer than all of them: a start asks nine times.
    gaps = [max(b - a for a, b in pairwise([*fired, fired[0] + around])) if fired else math.inf for fired in steps]
    return pattern.step_period_s * np.array(gaps)
