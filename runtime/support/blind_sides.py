"""The directions in which a ring never looks, and what they forbid: the texts of `check`, `init` and `run`.

The rule is that of each cycle (`behaviors.surroundings.field_of_view`): the robot drives only towards where the ring
has looked.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from behaviors.surroundings.field_of_view import path_half_angle_rad, seen_speed_m_s
from config.errors import WRONG_CALL, UserError
from config.settings import Settings
from perception.percept import Pose
from runtime.support.pattern_check import gap_note, oldest_percept

SAME_RAD: Final = 1e-6
"""Beams that overlap by less end side by side."""
STEP_DEG: Final = 1
"""Step of the directions that are tried."""
COURSE_DEG: Final = 2
"""Step of the courses that are tried."""
STAND_DEG: Final = 180
"""A ring that hears less of a turn seldom finds itself at one stand: of 24 in known rooms three sensors of ±15° in
front were right at none, five at 10, `hobby8` (224°) at 16, `amigo` (237°) at 20, `p3dx` (324°) at 24. After 12 m of
way each was right in all of eight. Three sensors named no drum that they drove at (0 of 6), only what they passed."""
MEETS_M: Final = 1.0
"""Neighbouring beams that meet nearer before the rim hear an object before it comes between them; those of all
shipped rings but the AmigoBot's meet within 0.7 m ahead."""
AHEAD_RAD: Final = math.radians(60.0)
"""A gap farther from straight ahead is beside the way."""
SLOW_SHARE: Final = 0.99
"""A speed below this share of the base velocity is named."""


def blind_sides_deg(settings: Settings) -> list[tuple[int, int]]:
    """Return the sectors of the ring's frame in which no sensor that fires looks: begin and end, degrees.

    Both ends count counter-clockwise from straight ahead, and an end is greater than its begin.
    """
    view = oldest_percept(settings, 0.0).field_of_view
    axes = view.bearings_rad[np.isfinite(view.ages_s)]
    directions = np.arange(0, 360, STEP_DEG)
    off = np.radians(directions)[:, None] - axes[None, :]
    off = np.abs(np.remainder(off + math.pi, math.tau) - math.pi)
    blind = ~(off <= view.half_angle_rad + math.radians(0.5 * STEP_DEG)).any(axis=1)
    if blind.all():
        return [(-180, 180)]
    begins = directions[blind & ~np.roll(blind, 1)].tolist()
    ends = directions[blind & ~np.roll(blind, -1)].tolist()
    return sorted(
        (begin if begin <= 180 else begin - 360, end + (360 if end < begin else 0) - (0 if begin <= 180 else 360))
        for begin in begins
        for end in [min(ends, key=lambda end: (end - begin) % 360)]
    )


def blind_notes(settings: Settings) -> list[str]:
    """Return what the ring's blind sides and gaps cost, one text each; none where it looks all round."""
    sides, gaps = blind_sides_deg(settings), _gap_notes(settings)
    if not sides:
        return gaps
    heard_deg = max(0, 360 - sum(end - begin + 1 for begin, end in sides))
    arbiter, body = settings.behaviors.arbiter, settings.body
    path_deg = math.degrees(path_half_angle_rad(body, arbiter.clearance_m))
    where = " and ".join(f"{begin}° to {end}°" for begin, end in sides)
    notes = [
        f"ring: no sensor looks from {where} (counter-clockwise from its front): what stands there is known only if "
        f"the ring heard it before, and the robot never drives there: its path needs every direction within "
        f"{path_deg:.0f}° of the way"
    ]
    if settings.body.synchro:
        notes.append(
            "ring: it does not turn with the wheels, so each goal, leg, or step of a mission that leads to a blind "
            "side stops there; choose ways that it sees, or mount sensors all round"
        )
    else:
        back_m_s = _speed_m_s(settings, math.pi)
        # A robot that does not drive ahead gets into no dead end.
        if gap_note(settings) is None and back_m_s < SLOW_SHARE * arbiter.base_velocity_m_s:
            back = "never drives backwards" if back_m_s == 0.0 else f"drives backwards at {back_m_s:.2f} m/s at most"
            notes.append(
                f"ring: the robot {back}; out of a dead end it turns on the spot, which needs no look as the body is "
                "round, and then stands until the ring has looked along the new way"
            )
    if heard_deg < STAND_DEG:
        notes.append(
            f"ring: at one place it hears {heard_deg}° of 360°, and one side of what stands there: in a known room "
            "it does not find itself before it has turned or driven, and it recognises an object once it has driven "
            "past or round it"
        )
    return notes + gaps


def _gap_notes(settings: Settings) -> list[str]:
    """Return what gaps between neighbouring beams cost that look side by side and do not meet; at most one text.

    Sensors on a rim whose beams end side by side leave a strip as wide as their distance, at any range.
    """
    half = math.radians(settings.ring.beam_half_angle_deg)
    widest_m, meets_m = max(_gaps_m(settings, half), default=(0.0, 0.0), key=lambda gap: (gap[1], gap[0]))
    if meets_m <= MEETS_M:
        return []
    where = "at any range" if math.isinf(meets_m) else f"up to {meets_m:.1f} m ahead"
    wider = (
        deg
        for deg in range(math.ceil(settings.ring.beam_half_angle_deg), 90)
        if all(meets <= MEETS_M for _, meets in _gaps_m(settings, math.radians(deg)))
    )
    return [
        f"ring: neighbouring beams leave a strip {widest_m:.2f} m wide between them, {where}: what is narrower, or a "
        "post or drum that reflects like a mirror, is not heard there until the robot is beside it or touches it; "
        f"beams of ±{next(wider, 90)}°, or sensors nearer to each other, close it"
    ]


def _gaps_m(settings: Settings, half_rad: float) -> list[tuple[float, float]]:
    """Return width and range (from the rim) of the gap between each two neighbouring beams that end side by side, m.

    Parameters
    ----------
    settings
        The run's: its ring's mounts and the body's radius.
    half_rad
        Half of the beams' opening, rad.
    """
    mounts = sorted(settings.ring.mounts, key=lambda mount: mount[2] % math.tau)
    gaps = []
    for (x1, y1, a1), (x2, y2, a2) in zip(mounts, [*mounts[1:], *mounts[:1]], strict=True):
        apart = (a2 - a1) % math.tau
        overlap = 2.0 * half_rad - apart
        middle = math.remainder(a1 + 0.5 * apart, math.tau)
        is_ahead = settings.body.synchro or abs(middle) <= AHEAD_RAD
        if overlap < -SAME_RAD or not is_ahead:
            continue
        edge, dx, dy = a1 + half_rad, x2 - x1, y2 - y1
        width_m = math.cos(edge) * dy - math.sin(edge) * dx
        if width_m <= 0.0:
            continue
        if overlap < SAME_RAD:
            gaps.append((width_m, math.inf))
            continue
        other = a2 - half_rad
        along_m = (dy * math.cos(other) - dx * math.sin(other)) / math.sin(overlap)
        x_m, y_m = x1 + along_m * math.cos(edge), y1 + along_m * math.sin(edge)
        gaps.append((width_m, math.hypot(x_m, y_m) - settings.body.radius_m))
    return gaps


def way_refusal(settings: Settings, course_rad: float | None) -> str | None:
    """Return why a ring that does not turn with the wheels forbids a way, None if it does not.

    The robot comes to any place if the courses that it may drive lie all round. Otherwise it comes only to directions
    between two of them that are less than 180° apart.

    Parameters
    ----------
    settings : Settings
        The run's.
    course_rad : float or None
        Direction of the place from the robot, in the ring's frame, rad; None: it may lie anywhere.
    """
    if not settings.body.synchro or not blind_sides_deg(settings):
        return None
    courses = [deg for deg in range(0, 360, COURSE_DEG) if _speed_m_s(settings, math.radians(deg)) > 0.0]
    if not courses:
        return None  # `refuse_undrivable` says so
    gaps = [
        ((after - before - 1) % 360 + 1, before)
        for before, after in zip(courses, [*courses[1:], courses[0]], strict=True)
    ]
    widest, begin = max(gaps)
    if widest < 180:
        return None
    if course_rad is None:
        what = "the mission may lead anywhere"
    else:
        into = (math.degrees(course_rad) - begin) % 360.0
        if not COURSE_DEG < into < widest - COURSE_DEG:
            return None
        what = f"the goal lies at {math.degrees(course_rad):.0f}° from the ring's front"
    first, last = (begin + widest) % 360, begin
    return (
        f"{what}, and the robot drives only at {first - 360 if first > last else first}° to {last}°: its ring does "
        "not turn with the wheels and looks nowhere else; choose a place that lies there, or mount sensors all round"
    )


def refuse_blind_ways(settings: Settings) -> None:
    """Raise an error if the run's goal or mission leads where the ring never looks.

    Raises
    ------
    UserError
        It does; the text says where the robot can drive.
    """
    goal, course_rad = settings.goal, None
    if goal is not None and goal.frame == "odom":
        course_rad = math.atan2(goal.y_m, goal.x_m)
    why = None if course_rad is None and settings.mission is None else way_refusal(settings, course_rad)
    if why is not None:
        raise UserError(why, WRONG_CALL)


def _speed_m_s(settings: Settings, course_rad: float) -> float:
    """Return the speed that the ring allows at a course in its own frame, m/s."""
    percept = replace(oldest_percept(settings, 0.0), pose=Pose(0.0, 0.0, course_rad))
    return seen_speed_m_s(percept, settings.body, settings.behaviors.arbiter.clearance_m)
