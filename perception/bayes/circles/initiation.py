"""Circle hypotheses: where an unexplained segment suggests a model's body.

The paper starts hypotheses from clusters of segments; but a cluster joins drums that stand a foot apart, and splits a
drum seen from two sides. As in the paper, relaxation (§3.4) moves the body onto the outline map; the raw readings
then decide whether it is an object, against every alternative.
"""

from __future__ import annotations

import math

from perception.bayes.circles.alternatives import fit_other_circle, fit_other_line, mean_bearing, score
from perception.bayes.circles.heard_rays import try_other_rays
from perception.bayes.inference.beam import assume_rays
from perception.bayes.inference.cross_path import is_crossed
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.occlusion import keep_relevant
from perception.bayes.inference.outline_map import (
    enter_attracting,
    relax_hypothesis,
    segments_near,
    set_hypothesis,
)
from perception.bayes.inference.range_fit import fit_circle
from perception.bayes.inference.reservoir import gather_history, keep_reading
from perception.bayes.inference.track_labels import assign_number, clear_track, free_track, is_rejected
from perception.bayes.memory.elements import ATTRACTING_MAX
from perception.bayes.memory.parameters import (
    ATTRACTING_MIN,
    CENTRE_VARIANCE_MAX_M2,
    CIRCLE_AROUND_M,
    CIRCLE_EVIDENCE_MIN_NAT,
    CIRCLE_READINGS_MIN,
    CIRCLE_RESTS_M,
    CIRCLE_RESTS_RAD,
    FACING_RADII,
    FIRST_FIT_SOFTNESS,
    FIT_SOFTNESS,
    OTHER_FIT_STEPS,
    OUTLINE_CELL_M,
    RIVAL_OVER_UNKNOWN_NAT,
    SWITCH_LEAD_NAT,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import FREE, TENTATIVE, CircleTrack, CircleTracks, StateRecord
from perception.kernel import kernel


@kernel
def is_known(tracks: CircleTracks, p: SettingsRecord, x: float, y: float, shift: float, nx: float, ny: float) -> bool:
    """Return whether a track explains the surface of a body at (x, y).

    Parameters
    ----------
    tracks, p
        The circles and the settings.
    x, y : float
        The body's centre, m.
    shift : float
        A track of radius ρ is compared at the centre that a body of this radius with the same surface would have;
        where negative, at its own.
    nx, ny : float
        Normal of the surface.
    """
    for t in range(len(tracks)):
        track = tracks[t]
        if track.status != FREE:
            k = shift - track.radius if shift >= 0.0 else 0.0
            if math.hypot(x - k * nx - track.x, y - k * ny - track.y) < p[0].merge_m:
                return True
    return False


@kernel
def relax_onto_map(s: StateRecord, p: SettingsRecord, kind: int) -> None:
    """Move the scratch's hypothesis of a circle by relaxation (paper §3.4) onto the mapped segments that face it."""
    scratch = s[0].scratch
    x, y = scratch.hypothesis.x, scratch.hypothesis.y
    radius = p[0].circles[kind].radius_m
    near = segments_near(s[0].buckets, OUTLINE_CELL_M, x, y, radius + CIRCLE_AROUND_M, scratch.near)
    attracting = 0
    for j in range(near):
        segment = scratch.near[j]
        deep = segment.normal_x * (x - segment.x) + segment.normal_y * (y - segment.y)
        if deep > FACING_RADII * radius:
            enter_attracting(segment, scratch.attracting[attracting])
            attracting += 1
            if attracting == ATTRACTING_MAX:
                break
    if attracting >= ATTRACTING_MIN:
        relax_hypothesis(
            s, p[0].circles[kind].chords[:], attracting, CIRCLE_RESTS_M, CIRCLE_RESTS_RAD, OTHER_FIT_STEPS
        )


@kernel
def reset_circle(track: CircleTrack) -> None:
    """Set a circle's track to zero, but for its number, its marks and the readings beyond the counts of its bins."""
    clear_track(track)
    track.kind = 0
    track.alternative = 0
    track.other_rays = 0
    track.rays_leads[:] = 0.0
    track.is_named = 0
    track.radius = 0.0
    track.root_xx = 0.0
    track.root_yx = 0.0
    track.root_yy = 0.0
    track.covariance_xx = 0.0
    track.covariance_xy = 0.0
    track.covariance_yy = 0.0
    track.misses = 0.0
    track.dispersion = 0.0
    track.unknown_nat = 0.0
    track.outline_lead = 0.0
    track.round_lead = 0.0
    track.room_lead = 0.0
    track.sides = 0
    track.is_confirmed = 0
    track.leads[:] = 0.0
    track.noise_nat[:] = 0.0


@kernel
def restart_circle(
    s: StateRecord, track: CircleTrack, kind: int, radius: float, x: float, y: float, n: int
) -> None:  # fmt: skip
    """Set a track to a tentative one on the first `n` readings of the scratch.

    Parameters
    ----------
    s : (1,) State
        Memory.
    track : CircleTrack
        Updated, but for its number and its marks.
    kind, radius, x, y
        Index of the circle, its radius and its centre, m.
    n : int
        Readings.
    """
    reset_circle(track)
    track.status = TENTATIVE
    track.kind = kind
    track.unseen = n
    track.x = x
    track.y = y
    track.radius = radius
    for j in range(n):
        if not is_crossed(s[0].scratch.readings[j]):
            keep_reading(track, x, y, s[0].scratch.readings[j])


@kernel
def start_circle(
    s: StateRecord, tracks: CircleTracks, kind: int, radius: float, x: float, y: float, n: int
) -> int:  # fmt: skip
    """Start a tentative track on the first `n` readings of the scratch; return its index, or −1 without a free track.

    Parameters
    ----------
    s, tracks
        Memory and circles, updated.
    kind, radius, x, y, n
        As for `restart_circle`.
    """
    t = free_track(tracks)
    if t < 0:
        return -1
    restart_circle(s, tracks[t], kind, radius, x, y, n)
    assign_number(s, tracks[t])
    return t


@kernel
def gather_relevant(
    s: StateRecord, tracks: CircleTracks, p: SettingsRecord, x: float, y: float, radius: float
) -> int:  # fmt: skip
    """Copy the remembered readings that bear on a new circle to the scratch; return their number.

    They are the first of the scratch's `readings`; `predicted` and `others` are overwritten, too. The circle is heard
    by the rays that `assume_rays` set last: call that first. It has no track yet, so any track may explain a reading.

    Parameters
    ----------
    s, tracks, p
        Memory, circles and settings.
    x, y, radius : float
        The circle, m.
    """
    return keep_relevant(s, tracks, p, gather_history(s, p, x, y, radius), x, y, radius, -1)


UNTRIED, SETTLED, UNSUPPORTED = range(3)
"""Outcomes of a hypothesis: too few readings; a track, or a reason for none; the readings do not support it."""


@kernel
def initiate_circle(
    s: StateRecord, tracks: CircleTracks, p: SettingsRecord, kind: int, x: float, y: float, nx: float, ny: float
) -> int:  # fmt: skip
    """Try a circle behind a segment and start a track if the readings support it; return 1 if that took work.

    Where they do not, it is tried by another number of rays at times, which may be how the place is heard.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    kind : int
        Index of the circle.
    x, y, nx, ny : float
        The segment's middle (m) and unit normal, away from the sensors.
    """
    radius = p[0].circles[kind].radius_m
    hypothesis = s[0].scratch.hypothesis
    set_hypothesis(s, x + radius * nx, y + radius * ny, 0.0)
    if is_known(tracks, p, hypothesis.x, hypothesis.y, radius, nx, ny):
        return 0
    relax_onto_map(s, p, kind)
    outcome = try_circle(s, tracks, p, kind, nx, ny)
    if outcome == UNSUPPORTED and try_other_rays(s, tracks, p, kind):
        try_circle(s, tracks, p, kind, nx, ny)
    return min(outcome, 1)


@kernel
def best_circle(
    s: StateRecord,
    p: SettingsRecord,
    kind: int,
    n: int,
    at: tuple[float, float, float],
    bearing: tuple[float, float],
    own: float,
) -> tuple[int, float, float, float]:
    """Return the circle that explains the readings best, its evidence (nat) and its place (m).

    Parameters
    ----------
    s, p, kind
        As for `initiate_circle`.
    n : int
        Relevant readings in the scratch.
    at : tuple of float
        The place (m) of a circle of `kind`, and its radius.
    bearing : tuple of float
        Mean direction from the sensors, as of `mean_bearing`.
    own : float
        Its evidence, nat; another one must lead it.
    """
    fit = s[0].scratch.circle_fit
    chosen, best, best_x, best_y = kind, own, at[0], at[1]
    for k in range(p[0].circle_count):
        if k != kind:
            prior = p[0].model_prior_nat if k < p[0].model_count else 0.0
            v = fit_other_circle(s, p, n, at, bearing, p[0].circles[k].radius_m, OTHER_FIT_STEPS) + prior
            if v > best + SWITCH_LEAD_NAT:
                chosen, best, best_x, best_y = k, v, fit.x, fit.y
    return chosen, best, best_x, best_y


@kernel
def try_circle(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, kind: int, nx: float, ny: float) -> int:
    """Start a track at the scratch's hypothesis if the readings support it; return which of the outcomes it is.

    Parameters
    ----------
    s, tracks, p, kind, nx, ny
        As for `initiate_circle`.
    """
    scratch = s[0].scratch
    fit = scratch.circle_fit
    radius = p[0].circles[kind].radius_m
    hypothesis = scratch.hypothesis
    assume_rays(s, p, s[0].rays)
    n = gather_relevant(s, tracks, p, hypothesis.x, hypothesis.y, radius)
    if n < CIRCLE_READINGS_MIN:
        return UNTRIED
    noise = noise_variance(s, p)
    if not fit_circle(
        scratch.readings[:n],
        (hypothesis.x, hypothesis.y, radius),
        p,
        FIRST_FIT_SOFTNESS,
        noise,
        OTHER_FIT_STEPS,
        scratch.predicted,
        fit,
    ):
        return UNTRIED
    n = gather_relevant(s, tracks, p, fit.x, fit.y, radius)
    if not fit_circle(
        scratch.readings[:n],
        (fit.x, fit.y, radius),
        p,
        FIT_SOFTNESS,
        noise,
        OTHER_FIT_STEPS,
        scratch.predicted,
        fit,
    ):
        return UNTRIED
    x, y = fit.x, fit.y
    h00, h01, h11 = fit.information_xx, fit.information_xy, fit.information_yy
    llr = score(s, p, n, x, y, radius)
    near = scratch.score.near
    if scratch.score.hits < CIRCLE_READINGS_MIN or llr < CIRCLE_EVIDENCE_MIN_NAT:
        return UNSUPPORTED
    prior = p[0].model_prior_nat
    bearing = mean_bearing(scratch.readings[:n], scratch.predicted, x, y, p[0].gate_m)
    own = llr + (prior if kind < p[0].model_count else 0.0)
    if fit_other_line(s, p, n, (x, y, radius), bearing, OTHER_FIT_STEPS) > own + SWITCH_LEAD_NAT:
        return UNSUPPORTED
    chosen, best, best_x, best_y = best_circle(s, p, kind, n, (x, y, radius), bearing, own)
    if chosen == kind and llr < p[0].unknown_nat * near:
        return UNSUPPORTED
    if chosen != kind and best < p[0].unknown_nat * near + RIVAL_OVER_UNKNOWN_NAT:
        return UNSUPPORTED
    if is_known(tracks, p, best_x, best_y, -1.0, nx, ny) or is_rejected(s, best_x, best_y, chosen, best):
        return SETTLED
    t = start_circle(s, tracks, chosen, p[0].circles[chosen].radius_m, best_x, best_y, n)
    if t < 0:
        return SETTLED
    det = h00 * h11 - h01 * h01
    track = tracks[t]
    track.log_likelihood_ratio = llr
    track.covariance_xx = min(h11 / det, CENTRE_VARIANCE_MAX_M2) if det > 0.0 else CENTRE_VARIANCE_MAX_M2
    track.covariance_yy = min(h00 / det, CENTRE_VARIANCE_MAX_M2) if det > 0.0 else CENTRE_VARIANCE_MAX_M2
    track.root_xx = math.sqrt(track.covariance_xx)
    track.root_yy = math.sqrt(track.covariance_yy)
    return SETTLED
