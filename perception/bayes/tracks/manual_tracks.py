"""Tracks that a user places or moves, refined like any other track.

A user's pose is wrong by a decimetre or two. As for a hypothesis, the paper's relaxation (§3.4) first moves the model
onto the outline map; then the raw readings refine it.
"""

from __future__ import annotations

import math

from perception.bayes.circles.initiation import (
    gather_relevant,
    relax_onto_map,
    restart_circle,
    start_circle,
)
from perception.bayes.inference.beam import assume_rays
from perception.bayes.inference.occlusion import keep_relevant
from perception.bayes.inference.outline_map import set_hypothesis
from perception.bayes.inference.reservoir import copy_reservoir, gather_history
from perception.bayes.inference.track_labels import assign_number, free_track
from perception.bayes.memory.job_records import REFINEMENT
from perception.bayes.memory.parameters import (
    CENTRE_VARIANCE_MAX_M2,
    PLACED_ROUNDS,
    PLACED_STRAY_MAX_M,
    PLACED_STRAY_MAX_RAD,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import PLACED, CircleTrack, CircleTracks, StateRecord
from perception.bayes.polygons.initiation import relax_polygon, restart_polygon
from perception.bayes.polygons.job import end_job
from perception.bayes.polygons.readings import gather_polygon_history
from perception.kernel import kernel


@kernel
def settle_circle(s: StateRecord, p: SettingsRecord, kind: int, x: float, y: float) -> None:
    """Set the scratch's hypothesis to a circle relaxed onto the map from (x, y).

    Parameters
    ----------
    s, p
        Memory and settings.
    kind : int
        Which circle.
    x, y : float
        m.
    """
    hypothesis = s[0].scratch.hypothesis
    set_hypothesis(s, x, y, 0.0)
    for _ in range(PLACED_ROUNDS):
        relax_onto_map(s, p, kind)
    if math.hypot(hypothesis.x - x, hypothesis.y - y) > PLACED_STRAY_MAX_M:
        hypothesis.x = x
        hypothesis.y = y


@kernel
def mark_placed(track: CircleTrack) -> None:
    """Mark a circle as placed by a user, and set its covariance to that of a user's position."""
    track.covariance_xx = CENTRE_VARIANCE_MAX_M2
    track.covariance_yy = CENTRE_VARIANCE_MAX_M2
    track.root_xx = math.sqrt(CENTRE_VARIANCE_MAX_M2)
    track.root_yy = track.root_xx
    track.marks |= PLACED


@kernel
def place_circle(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, kind: int, x: float, y: float) -> int:
    """Start a circle track about (x, y) on the remembered readings; return its index, −1 without a free track.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    kind : int
        Which circle.
    x, y : float
        m.
    """
    radius = p[0].circles[kind].radius_m
    settle_circle(s, p, kind, x, y)
    x = s[0].scratch.hypothesis.x
    y = s[0].scratch.hypothesis.y
    assume_rays(s, p, s[0].rays)
    n = gather_relevant(s, tracks, p, x, y, radius)
    t = start_circle(s, tracks, kind, radius, x, y, n)
    if t >= 0:
        mark_placed(tracks[t])
    return t


@kernel
def move_circle(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, t: int, x: float, y: float) -> None:
    """Restart circle track `t` about (x, y), on its own readings if near, else on the remembered ones.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    t : int
        The track.
    x, y : float
        m.
    """
    track = tracks[t]
    kind = track.kind
    radius = track.radius
    settle_circle(s, p, kind, x, y)
    assume_rays(s, p, s[0].rays)
    x = s[0].scratch.hypothesis.x
    y = s[0].scratch.hypothesis.y
    if math.hypot(x - track.x, y - track.y) < radius + p[0].gate_m:
        n = copy_reservoir(track, s[0].scratch.readings)
    else:
        n = gather_history(s, p, x, y, radius)
    restart_circle(s, track, kind, radius, x, y, keep_relevant(s, tracks, p, n, x, y, radius, t))
    mark_placed(track)


@kernel
def settle_polygon(s: StateRecord, p: SettingsRecord, model: int, x: float, y: float, heading: float) -> None:
    """Set the scratch's hypothesis to a polygon relaxed onto the map from a pose.

    Parameters
    ----------
    s, p
        Memory and settings.
    model : int
        Which polygon.
    x, y, heading : float
        m, rad.
    """
    hypothesis = s[0].scratch.hypothesis
    set_hypothesis(s, x, y, heading)
    for _ in range(PLACED_ROUNDS):
        relax_polygon(s, p, model)
    if (
        math.hypot(hypothesis.x - x, hypothesis.y - y) > PLACED_STRAY_MAX_M
        or abs(hypothesis.heading - heading) > PLACED_STRAY_MAX_RAD
    ):
        set_hypothesis(s, x, y, heading)


@kernel
def leave_job(s: StateRecord, t: int) -> None:
    """End the job if it refines polygon `t`, which has changed."""
    if s[0].job.kind == REFINEMENT and s[0].job.track == t:
        end_job(s)


@kernel
def place_polygon(s: StateRecord, p: SettingsRecord, model: int, x: float, y: float, heading: float) -> int:
    """Start a polygon track about a pose on the remembered readings; return its index, −1 without a free track.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    model : int
        Which polygon.
    x, y, heading : float
        m, rad.
    """
    t = free_track(s[0].polygons)
    if t >= 0:
        leave_job(s, t)
        settle_polygon(s, p, model, x, y, heading)
        track = s[0].polygons[t]
        at = s[0].scratch.hypothesis
        n = gather_polygon_history(s, p, model, at.x, at.y)
        restart_polygon(track, model, at.x, at.y, at.heading, s[0].scratch.readings[:n])
        assign_number(s, track)
        track.marks = PLACED
    return t


@kernel
def move_polygon(s: StateRecord, p: SettingsRecord, t: int, x: float, y: float, heading: float) -> None:
    """Restart polygon track `t` about a pose, on its own readings if near, else on the remembered ones.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    t : int
        The track.
    x, y, heading : float
        m, rad.
    """
    leave_job(s, t)
    track = s[0].polygons[t]
    model = track.model
    settle_polygon(s, p, model, x, y, heading)
    at = s[0].scratch.hypothesis
    if math.hypot(at.x - track.x, at.y - track.y) < p[0].polygons[model].outer_radius_m + p[0].gate_m:
        n = copy_reservoir(track, s[0].scratch.readings)
    else:
        n = gather_polygon_history(s, p, model, at.x, at.y)
    restart_polygon(track, model, at.x, at.y, at.heading, s[0].scratch.readings[:n])
    track.marks |= PLACED
