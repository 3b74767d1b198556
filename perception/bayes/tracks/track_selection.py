"""Selection of the track to refine in the next quantum.

The value of a quantum is the unseen evidence for an object's size, more where its place is unsure; among those above
the threshold the nearer to the robot goes first, as the robot meets it next. A budget that is spent in every cycle
would leave some waiting for ever: a track that was passed over too often goes before all others, longest wait first,
so that none waits for more than `PASSED_OVER_MAX` quanta and one for each other track.
"""

from __future__ import annotations

import math
from typing import Final

from perception.bayes.memory.elements import MAX_POLYGONS
from perception.bayes.memory.parameters import (
    FINAL_VALUE,
    PASSED_OVER_MAX,
    RESERVOIR_OFFSET,
    UNSURE_FACTOR,
    UNSURE_ROOT_M,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import FREE, AnyTrack, CircleTrack, CircleTracks, StateRecord
from perception.kernel import kernel
from perception.shared_numbers import CERTAIN_PROBABILITY

OVERDUE: Final = 1e9
"""Priority of a track that was passed over more than `PASSED_OVER_MAX` times."""


@kernel
def unseen_evidence(track: AnyTrack, idle_firings: int, threshold: float, weight: float) -> float:
    """Return the unseen readings of a track relative to its size, times `weight`.

    An idle track is refined until no reading is unseen, and a few times more.

    Parameters
    ----------
    track
        A circle or a polygon.
    idle_firings : int
        From how many firings without evidence on.
    threshold : float
        Value from which on a track waits for refinement.
    weight : float
        Factor.
    """
    v: float = weight * (track.unseen / (track.reservoir + RESERVOIR_OFFSET))
    if track.idle_firings > idle_firings and track.final_refinements > 0:
        v += threshold + FINAL_VALUE
    return v


@kernel
def circle_value(track: CircleTrack, p: SettingsRecord, threshold: float) -> float:
    """Return the value of a quantum for a circle; above `threshold` the circle waits for refinement.

    Parameters
    ----------
    track : CircleTrack
        The circle.
    p : (1,) Settings
        Settings.
    threshold : float
        Value from which on a track waits for refinement.
    """
    if track.status == FREE:
        return 0.0
    is_unsure = max(track.root_xx, track.root_yy) > UNSURE_ROOT_M or track.probability < CERTAIN_PROBABILITY
    return unseen_evidence(track, p[0].idle_firings, threshold, UNSURE_FACTOR if is_unsure else 1.0)


@kernel
def priority(s: StateRecord, p: SettingsRecord, value: float, track: CircleTrack) -> float:
    """Return the priority of a circle; the circle of greatest priority is refined next.

    At the end of the ring's range a track counts half as much as next to the robot.

    Parameters
    ----------
    s, p
        Memory and settings.
    value : float
        From `circle_value`.
    track : CircleTrack
        The circle.
    """
    if track.passed_over > PASSED_OVER_MAX:
        return OVERDUE + track.passed_over
    return value * p[0].range_max_m / (p[0].range_max_m + math.hypot(track.x - s[0].ring_x, track.y - s[0].ring_y))


@kernel
def is_waiting(tracks: CircleTracks, p: SettingsRecord, threshold: float) -> bool:
    """Return whether a circle waits for refinement.

    Parameters
    ----------
    tracks, p
        Circles and settings.
    threshold : float
        Value from which on a track waits for refinement.
    """
    most = 0.0
    for t in range(len(tracks)):
        most = max(most, circle_value(tracks[t], p, threshold))
    return most > threshold


@kernel
def choose_circle(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, threshold: float) -> int:
    """Return the circle to refine next, −1 where none waits; count a pass for the others that wait.

    Parameters
    ----------
    s, tracks, p
        Memory, circles (updated) and settings.
    threshold : float
        Value from which on a track waits for refinement.
    """
    best = -1.0
    chosen = -1
    for t in range(len(tracks)):
        track = tracks[t]
        v = circle_value(track, p, threshold)
        if v > threshold:
            v = priority(s, p, v, track)
            track.passed_over += 1
            if v > best:
                best = v
                chosen = t
    if chosen >= 0:
        tracks[chosen].passed_over = 0
    return chosen


@kernel
def choose_polygon(s: StateRecord, p: SettingsRecord, threshold: float) -> int:
    """Return the polygon to refine next, or −1; the choice is that of `choose_circle` without regard to distance.

    Polygons that face each other across a passage share readings: with the nearer one first, one was found twice.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    threshold : float
        Value from which on a track waits for refinement.
    """
    best = -1.0
    chosen = -1
    for t in range(MAX_POLYGONS):
        track = s[0].polygons[t]
        v = 0.0
        if track.status != FREE:
            v = unseen_evidence(track, p[0].idle_firings, threshold, 1.0)
        if v > threshold:
            v = OVERDUE + track.passed_over if track.passed_over > PASSED_OVER_MAX else v
            track.passed_over += 1
            if v > best:
                best = v
                chosen = t
    if chosen >= 0:
        s[0].polygons[chosen].passed_over = 0
    return chosen
