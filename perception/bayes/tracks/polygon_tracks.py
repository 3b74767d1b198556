"""Refinement of polygon tracks, in stages.

A refinement is a job that each quantum advances: readings are divided between the track and its neighbours, its pose
is searched and evaluated, and its covariance is computed. The likelihood is flat at the top, because ranges are
rounded: the pose is the middle of the plateau, and the plateau's width is the uncertainty.
"""

from __future__ import annotations

import math

from perception.bayes.inference.reservoir import copy_reservoir
from perception.bayes.inference.track_labels import drop_track, outlives
from perception.bayes.memory.elements import MAX_POLYGONS
from perception.bayes.memory.job_records import (
    ASSIGN,
    JUDGE,
    LATTICE,
    NO_JOB,
    REFINEMENT,
    RESTART,
    SEARCH_NEAR,
    SEARCH_WIDE,
)
from perception.bayes.memory.parameters import ELSEWHERE_LEAD_NAT, PLACED_STRAY_MAX_M
from perception.bayes.memory.polygon_parameters import (
    FITTING_SHARE,
    LATTICE_ATTEMPTS,
    MANY_HITS,
    MANY_HITS_SURE,
    OVERLAP_RADII,
    POLYGON_DOUBT_PROBABILITY,
    POLYGON_DOUBT_SHARE,
    POLYGON_ESTABLISH_HITS,
    POLYGON_ESTABLISH_SURE,
    POLYGON_EVIDENCE_MIN_NAT,
    POLYGON_PROBABILITY,
    POLYGON_UNKNOWN_LEAD_NAT,
    QUANTUM_COST,
    TWIN_RADII,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import (
    CONFIRMED,
    ESTABLISHED,
    FREE,
    TENTATIVE,
    CircleTracks,
    PolygonTrack,
    StateRecord,
)
from perception.bayes.polygons.alternatives import compare_circles
from perception.bayes.polygons.association import leave_to_next_neighbour
from perception.bayes.polygons.initiation import advance_initiation, next_request
from perception.bayes.polygons.job import (
    advance_search,
    copy_pose,
    cost,
    end_job,
    is_search_over,
    keep_best,
    score_pose,
)
from perception.bayes.polygons.pose_restarts import (
    begin_pose_search,
    next_restart,
)
from perception.bayes.polygons.posterior import advance_lattice, begin_lattice, copy_triangle
from perception.bayes.tracks.model_check import is_on_long_walls
from perception.bayes.tracks.naming import is_sure_polygon
from perception.bayes.tracks.track_selection import choose_polygon
from perception.kernel import kernel


@kernel
def update_polygon_status(s: StateRecord, p: SettingsRecord, track: PolygonTrack) -> None:
    """Establish a track, make it tentative again, or end it.

    A track is established only after its covariance has been determined.
    """
    evidence = track.log_likelihood_ratio
    if (
        evidence < POLYGON_EVIDENCE_MIN_NAT
        or evidence < p[0].unknown_polygon_nat * track.near - POLYGON_UNKNOWN_LEAD_NAT
    ):
        drop_track(track)
    elif track.status == TENTATIVE:
        is_fitting = track.hits > FITTING_SHARE * track.near
        sure = POLYGON_ESTABLISH_SURE if track.hits < MANY_HITS else MANY_HITS_SURE
        is_heard = track.hits >= POLYGON_ESTABLISH_HITS and track.sure_hits >= sure
        if track.probability > POLYGON_PROBABILITY and is_fitting and is_heard:
            s[0].job.stage = LATTICE
            if track.covariance.xx > 0.0:
                track.status = ESTABLISHED
    elif track.probability < POLYGON_DOUBT_PROBABILITY or track.hits < POLYGON_DOUBT_SHARE * track.near:
        track.status = TENTATIVE
    else:
        s[0].job.stage = LATTICE


@kernel
def merge_polygons(s: StateRecord, p: SettingsRecord, t: int) -> None:
    """Leave one body in a place: merge twins, and of overlapping bodies keep an established and likelier one.

    A body that a user marked stays in any case.
    """
    track = s[0].polygons[t]
    inner = p[0].polygons[track.model].inner_radius_m
    for k in range(MAX_POLYGONS):
        other = s[0].polygons[k]
        if k == t or other.status == FREE:
            continue
        d = math.hypot(other.x - track.x, other.y - track.y)
        is_twin = d < TWIN_RADII * inner
        if not is_twin and d >= OVERLAP_RADII * inner:
            continue
        has_more = other.log_likelihood_ratio > track.log_likelihood_ratio
        is_marked = track.marks != 0 or other.marks != 0
        if is_twin or is_marked:
            has_more = outlives(other, track, has_more)
        if has_more:
            if is_twin or is_marked or other.status == ESTABLISHED:
                track.status = FREE
                return
        elif is_twin or is_marked or track.status == ESTABLISHED:
            other.status = FREE


@kernel
def begin_refinement(s: StateRecord, p: SettingsRecord, threshold: float) -> bool:
    """Begin a job for the polygon to refine next; return whether there is one.

    Parameters
    ----------
    s, p
        Memory, updated, and settings.
    threshold : float
        Least share of unseen evidence of a track to refine.
    """
    chosen = choose_polygon(s, p, threshold)
    if chosen < 0:
        return False
    track = s[0].polygons[chosen]
    if track.idle_firings > p[0].idle_firings:
        track.final_refinements -= 1
    track.unseen = 0
    track.refinements += 1
    job = s[0].job
    job.kind = REFINEMENT
    job.stage = ASSIGN
    job.track = chosen
    job.next_step = 0
    job.noise_level = s[0].noise_level
    job.reading_count = copy_reservoir(track, s[0].job_readings)
    return True


@kernel
def is_sure(track: PolygonTrack, p: SettingsRecord) -> bool:
    """Return whether a polygon's readings make it sure enough to be reported."""
    return is_sure_polygon(track, min(p[0].report_probability, POLYGON_PROBABILITY))


@kernel
def judge_polygon(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, t: int) -> None:
    """Update a track's pose, evidence and status from the pose search."""
    track = s[0].polygons[t]
    found = s[0].job.best
    track.log_likelihood_ratio = score_pose(s, p, track.model, found.x, found.y, found.heading)
    score = s[0].scratch.score
    x, y, heading = track.x, track.y, track.heading
    track.x = found.x
    track.y = found.y
    track.heading = found.heading
    track.hits = score.hits
    track.near = score.near
    track.sure_hits = score.sure_hits
    if is_on_long_walls(s, p, track) and drop_track(track):
        return
    compare_circles(s, tracks, p, track)
    update_polygon_status(s, p, track)
    if track.marks != 0:
        is_near = math.hypot(found.x - x, found.y - y) < PLACED_STRAY_MAX_M
        if is_sure(track, p) and (is_near or track.marks == CONFIRMED):
            track.marks &= CONFIRMED
        else:  # It would follow the echoes of other bodies anywhere.
            track.x = x
            track.y = y
            track.heading = heading
    if track.status != FREE:
        merge_polygons(s, p, t)


@kernel
def advance_refinement(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, left: int) -> int:
    """Continue a refinement for the rest of a quantum; return the cost.

    Readings are divided between the track and its neighbours; its pose is searched, widely and then near by; the
    evidence there decides its status; its covariance is computed last.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    left : int
        What is left of the quantum.
    """
    job = s[0].job
    t = job.track
    track = s[0].polygons[t]
    model = track.model
    stage = job.stage
    if stage == ASSIGN:
        if job.next_step < MAX_POLYGONS:
            return leave_to_next_neighbour(s, p, t)
        track.reservoir = job.reading_count
        begin_pose_search(s, t)
        return 1
    if stage in (SEARCH_WIDE, RESTART, SEARCH_NEAR):
        spent = advance_search(s, p, model, left)
        if is_search_over(s):
            if stage == SEARCH_NEAR:
                keep_best(s)
                job.stage = JUDGE
                return spent
            if stage == SEARCH_WIDE:
                keep_best(s)
                copy_pose(job.best, job.middle)
                job.stage = RESTART
                job.next_step = 0
            elif job.search.log_likelihood_ratio > job.best_nat + ELSEWHERE_LEAD_NAT:
                keep_best(s)
            next_restart(s, p, t)
        return spent
    if stage == JUDGE:
        judge_polygon(s, tracks, p, t)
        if track.status != FREE and job.stage == LATTICE:
            begin_lattice(s, p, model, t)
        else:
            end_job(s)
        return cost((1 + p[0].circle_count) * job.reading_count, 1, p[0].polygons[model].side_count)
    spent = advance_lattice(s, p, model, left)
    if job.lattices == LATTICE_ATTEMPTS:
        copy_triangle(job.covariance, track.covariance)
        track.status = ESTABLISHED
        if track.marks == 0 or (track.marks == CONFIRMED and is_sure(track, p)):
            track.x = job.middle.x
            track.y = job.middle.y
            track.heading = job.middle.heading
        end_job(s)
    return spent


@kernel
def polygon_quantum(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, threshold: float) -> bool:
    """Continue the job for a quantum, or else begin the next job; return whether there was one.

    Refinements and hypotheses take turns where both wait.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    threshold : float
        As for `begin_refinement`.
    """
    job = s[0].job
    if job.kind == NO_JOB:
        job.refines_next = 1 - job.refines_next
        if job.refines_next == 1:
            if not begin_refinement(s, p, threshold) and not next_request(s):
                return False
        elif not next_request(s) and not begin_refinement(s, p, threshold):
            return False
    left = QUANTUM_COST
    while left > 0 and job.kind != NO_JOB:
        left -= advance_refinement(s, tracks, p, left) if job.kind == REFINEMENT else advance_initiation(s, p, left)
    return True
