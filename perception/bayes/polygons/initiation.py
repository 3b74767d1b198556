"""Polygon hypotheses: each distinct side of a model laid on an unexplained segment.

As for circles, the paper's relaxation (§3.4) moves the body onto the outline map, and the remembered raw readings
decide. Readings determine a position along a side badly, so each side is also tried shifted. A request takes no time;
a trial is a job.
"""

from __future__ import annotations

import math

from perception.bayes.inference.outline_map import (
    enter_attracting,
    relax_hypothesis,
    segments_near,
    set_hypothesis,
)
from perception.bayes.inference.reservoir import copy_reading, keep_reading
from perception.bayes.inference.track_labels import assign_number, clear_track, free_track, is_rejected
from perception.bayes.memory.elements import ATTRACTING_MAX, MAX_POLYGONS, REQUESTS_MAX, Reading
from perception.bayes.memory.job_records import INITIATION
from perception.bayes.memory.parameters import OUTLINE_CELL_M
from perception.bayes.memory.polygon_parameters import (
    APART_WHOLE,
    CHALLENGE_UNSEEN,
    COLLECTING_COST,
    FINE_ROUNDS,
    FINE_STEP_M,
    PARALLEL_COS,
    POLYGON_AROUND_M,
    POLYGON_HITS_MIN,
    POLYGON_RELAXATION_STEPS,
    POLYGON_RESTS_M,
    POLYGON_RESTS_RAD,
    POLYGONS_APART,
    REQUEST_SAME_M,
    SIDE_SHIFTS,
    TRIAL_EVIDENCE_MIN_NAT,
    TRIAL_READINGS_MAX,
    TRIAL_READINGS_MIN,
    TRIAL_ROUNDS,
    TRIAL_STEP_M,
    WHOLE_SHARE,
)
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, TENTATIVE, PolygonTrack, StateRecord
from perception.bayes.polygons.job import (
    advance_search,
    end_job,
    is_search_over,
    keep_best,
    score_pose,
    start_search,
)
from perception.bayes.polygons.readings import gather_polygon_history
from perception.kernel import kernel
from perception.records import Records

LAY, TRY, FINE = range(3)
"""Stages of a hypothesis, values of `PolygonJob.stage`: a side is laid on the segment, tried, and the best trial is
refined."""


@kernel
def gather_job_readings(s: StateRecord, p: SettingsRecord, model: int, cx: float, cy: float) -> int:
    """Copy the remembered readings that bear on a polygon at (cx, cy) to the job; return their number.

    Readings beyond the job's capacity are dropped at even spacing, because one sensor's readings follow another's.

    Parameters
    ----------
    s, p, model, cx, cy
        As for `gather_polygon_history`.
    """
    n = gather_polygon_history(s, p, model, cx, cy)
    kept = min(n, len(s[0].job_readings))
    for j in range(kept):
        copy_reading(s[0].scratch.readings[j * n // kept], s[0].job_readings[j])
    return kept


@kernel
def occupant(s: StateRecord, p: SettingsRecord, model: int, x: float, y: float) -> int:
    """Return the index of the track of the same model that stands at (x, y); −1 without one.

    Parameters
    ----------
    s, p, model
        Memory, settings, and index of the polygon.
    x, y : float
        m.
    """
    for t in range(MAX_POLYGONS):
        track = s[0].polygons[t]
        if track.status != FREE and track.model == model:
            is_whole = track.status == ESTABLISHED and track.hits > WHOLE_SHARE * track.near
            apart = (APART_WHOLE if is_whole else POLYGONS_APART) * p[0].polygons[model].inner_radius_m
            if math.hypot(x - track.x, y - track.y) < apart:
                return t
    return -1


@kernel
def relax_polygon(s: StateRecord, p: SettingsRecord, model: int) -> None:
    """Move the scratch's hypothesis by the paper's relaxation (§3.4): the map's segments attract its sides."""
    scratch = s[0].scratch
    hypothesis = scratch.hypothesis
    outline = p[0].polygons[model]
    near = segments_near(
        s[0].buckets,
        OUTLINE_CELL_M,
        hypothesis.x,
        hypothesis.y,
        outline.outer_radius_m + POLYGON_AROUND_M,
        scratch.near,
    )
    attracting = min(near, ATTRACTING_MAX)
    for j in range(attracting):
        enter_attracting(scratch.near[j], scratch.attracting[j])
    relax_hypothesis(
        s,
        outline.relaxation_sides[: outline.side_count],
        attracting,
        POLYGON_RESTS_M,
        POLYGON_RESTS_RAD,
        POLYGON_RELAXATION_STEPS,
    )


@kernel
def lay_side(
    s: StateRecord, p: SettingsRecord, model: int, k: int, shift: float, x: float, y: float, nx: float, ny: float
) -> None:
    """Set the scratch's hypothesis so that a side lies on a segment and faces against its normal.

    Parameters
    ----------
    s, p
        Memory and settings.
    model, k : int
        Which polygon, and which of its sides.
    shift : float
        Offset of the segment from the side's middle, in lengths of the side.
    x, y, nx, ny : float
        The segment's middle (m) and unit normal.
    """
    outline = p[0].polygons[model]
    begin = outline.sides[k]
    end = outline.sides[(k + 1) % outline.vertex_count]
    tx = end.x - begin.x
    ty = end.y - begin.y
    side_x = 0.5 * (begin.x + end.x) + shift * tx
    side_y = 0.5 * (begin.y + end.y) + shift * ty
    heading = math.atan2(-ny, -nx) - math.atan2(-tx, ty)
    c = math.cos(heading)
    sn = math.sin(heading)
    set_hypothesis(s, x - (c * side_x - sn * side_y), y - (sn * side_x + c * side_y), heading)


@kernel
def start_polygon(s: StateRecord, model: int, x: float, y: float, heading: float, evidence_nat: float) -> None:
    """Start a tentative track on the job's readings, if a track is free.

    Parameters
    ----------
    s, model
        Memory (updated), and index of the polygon.
    x, y, heading : float
        Its pose, m, rad.
    evidence_nat : float
        Its log ratio.
    """
    t = free_track(s[0].polygons)
    if t >= 0:
        track = s[0].polygons[t]
        restart_polygon(track, model, x, y, heading, s[0].job_readings[: s[0].job.reading_count])
        track.log_likelihood_ratio = evidence_nat
        assign_number(s, track)


@kernel
def reset_polygon(track: PolygonTrack) -> None:
    """Set a polygon track to zero, except its number, its marks and the readings beyond the counts of its bins."""
    clear_track(track)
    track.model = 0
    track.has_challenger = 0
    track.heading = 0.0
    track.sure_hits = 0.0
    track.covariance.xx = 0.0
    track.covariance.yx = 0.0
    track.covariance.yy = 0.0
    track.covariance.hx = 0.0
    track.covariance.hy = 0.0
    track.covariance.hh = 0.0
    track.challenger.x = 0.0
    track.challenger.y = 0.0
    track.challenger.heading = 0.0


@kernel
def restart_polygon(
    track: PolygonTrack, model: int, x: float, y: float, heading: float, readings: Records[Reading]
) -> None:
    """Set a track to a tentative one on the given readings.

    Parameters
    ----------
    track : PolygonTrack
        Updated, except its number and its marks.
    model, x, y, heading
        Which polygon, and its pose, m, rad.
    readings : (n,) Reading
        Raw ranges.
    """
    reset_polygon(track)
    track.status = TENTATIVE
    track.model = model
    track.unseen = len(readings)
    track.x = x
    track.y = y
    track.heading = heading
    for j in range(len(readings)):
        keep_reading(track, x, y, readings[j])


@kernel
def challenge(s: StateRecord, t: int, x: float, y: float, heading: float) -> None:
    """Give a track another pose to try on its own readings: its place is right, but its pose may be wrong.

    Parameters
    ----------
    s, t, x, y, heading
        Memory (updated), the track, and the other pose, m, rad.
    """
    track = s[0].polygons[t]
    track.has_challenger = 1
    track.unseen += CHALLENGE_UNSEEN
    track.challenger.x = x
    track.challenger.y = y
    track.challenger.heading = heading


@kernel
def request_polygon(s: StateRecord, model: int, x: float, y: float, nx: float, ny: float) -> int:
    """Queue a polygon hypothesis behind a segment; return 1, or 0 where the same was requested recently.

    Parameters
    ----------
    s, model
        Memory (updated), and index of the polygon.
    x, y, nx, ny : float
        The segment's middle (m) and unit normal, away from the sensors.
    """
    job = s[0].job
    for k in range(min(job.requests_made, REQUESTS_MAX)):
        it = s[0].requests[k]
        if (
            it.model == model
            and math.hypot(x - it.x, y - it.y) < REQUEST_SAME_M
            and nx * it.normal_x + ny * it.normal_y > PARALLEL_COS
        ):
            return 0
    request = s[0].requests[job.requests_made % REQUESTS_MAX]
    request.model = model
    request.x = x
    request.y = y
    request.normal_x = nx
    request.normal_y = ny
    request.is_done = 0
    job.requests_made += 1
    return 1


@kernel
def next_request(s: StateRecord) -> bool:
    """Begin a job for the newest waiting request; return whether there was one."""
    job = s[0].job
    for back in range(1, min(job.requests_made, REQUESTS_MAX) + 1):
        request = s[0].requests[(job.requests_made - back) % REQUESTS_MAX]
        if request.is_done == 0:
            request.is_done = 1
            job.kind = INITIATION
            job.stage = LAY
            job.model = request.model
            job.next_step = 0
            job.noise_level = s[0].noise_level
            job.best_nat = -math.inf
            job.segment_x = request.x
            job.segment_y = request.y
            job.segment_normal_x = request.normal_x
            job.segment_normal_y = request.normal_y
            return True
    return False


@kernel
def ways_to_lie(p: SettingsRecord, model: int) -> int:
    """Return how many distinct ways a model has to lie on a segment: its sides, and both faces of an open outline."""
    outline = p[0].polygons[model]
    if outline.is_closed > 0:
        return max(1, outline.vertex_count // outline.symmetry)
    return 2 * (outline.vertex_count - 1)


@kernel
def lay_next(s: StateRecord, p: SettingsRecord) -> int:
    """Lay the next side on the segment and start a search there, or from the best trial; return the cost."""
    job = s[0].job
    model = job.model
    sides = p[0].polygons[model].side_count
    k = job.next_step // len(SIDE_SHIFTS)
    if k >= ways_to_lie(p, model):
        if job.best_nat < TRIAL_EVIDENCE_MIN_NAT:
            end_job(s)
            return 1
        job.reading_count = gather_job_readings(s, p, model, job.best.x, job.best.y)
        start_search(s, job.best.x, job.best.y, job.best.heading, FINE_STEP_M, FINE_ROUNDS, len(s[0].job_readings))
        job.stage = FINE
        return COLLECTING_COST
    shift = SIDE_SHIFTS[job.next_step % len(SIDE_SHIFTS)]
    face = 1.0 if k < sides else -1.0
    nx, ny = face * job.segment_normal_x, face * job.segment_normal_y
    lay_side(s, p, model, k % sides, shift, job.segment_x, job.segment_y, nx, ny)
    job.next_step += 1
    if shift == 0.0:
        relax_polygon(s, p, model)
    hypothesis = s[0].scratch.hypothesis
    job.reading_count = gather_job_readings(s, p, model, hypothesis.x, hypothesis.y)
    if job.reading_count >= TRIAL_READINGS_MIN:
        start_search(
            s, hypothesis.x, hypothesis.y, hypothesis.heading, TRIAL_STEP_M, TRIAL_ROUNDS, TRIAL_READINGS_MAX
        )
        job.stage = TRY
    return COLLECTING_COST


@kernel
def advance_initiation(s: StateRecord, p: SettingsRecord, left: int) -> int:
    """Continue a hypothesis for the rest of a quantum; return the cost.

    Parameters
    ----------
    s, p, left
        Memory (updated), settings, and what is left of the quantum.
    """
    job = s[0].job
    model = job.model
    if job.stage == LAY:
        return lay_next(s, p)
    spent = advance_search(s, p, model, left)
    if not is_search_over(s):
        return spent
    found = job.search
    if job.stage == TRY:
        job.stage = LAY
        if found.log_likelihood_ratio > job.best_nat:
            keep_best(s)
        return spent
    evidence = score_pose(s, p, model, found.x, found.y, found.heading)
    score = s[0].scratch.score
    if evidence >= p[0].unknown_nat * score.near and score.hits >= POLYGON_HITS_MIN:
        t = occupant(s, p, model, found.x, found.y)
        if t < 0:
            if not is_rejected(s, found.x, found.y, POLYGON + model, evidence):
                start_polygon(s, model, found.x, found.y, found.heading, evidence)
        else:
            challenge(s, t, found.x, found.y, found.heading)
    end_job(s)
    return spent
