"""Refinement of one circle track: position, evidence, alternatives and status.

A quantum of refinement has a bounded cost: a posterior over at most a reservoir of readings, and one alternative (all
of them while little is known). Converged tracks are selected less often (see `track_selection`), so later
passes cost less than the first.
"""

from __future__ import annotations

import math

from perception.bayes.circles.alternatives import fit_other_circle, fit_other_line, mean_bearing, score
from perception.bayes.circles.corner_model import score_corner
from perception.bayes.circles.heard_rays import compare_rays, decide_rays
from perception.bayes.circles.lateral_search import search_across
from perception.bayes.circles.outline_check import other_bodies, outline_lead, round_lead
from perception.bayes.circles.posterior import posterior_circle
from perception.bayes.inference.beam import assume_rays
from perception.bayes.inference.likelihood import bounded_exp
from perception.bayes.inference.noise_estimation import add_residuals, noise_variance
from perception.bayes.inference.occlusion import keep_relevant
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.inference.range_fit import fit_circle, score_circle
from perception.bayes.inference.reservoir import add_crosses, copy_reservoir
from perception.bayes.inference.track_labels import drop_track, hold, may_become, merge_duplicates
from perception.bayes.memory.parameters import (
    CENTRE_VARIANCE_MAX_M2,
    CORNER_MISS_SHARE,
    DOUBT_PROBABILITY,
    DOUBTED_DISPERSION_SHARE,
    ESTABLISH_HITS,
    ESTABLISH_PROBABILITY,
    ESTABLISH_ROOT_M,
    FIT_LEAD_SIGMAS2,
    FIT_SOFTNESS,
    FITTED_REFINEMENTS,
    LATERAL_STEP_M,
    LINE_PRIOR_NAT,
    LOST_NAT,
    MODEL_CHECK_EVERY,
    OTHER_FIT_STEPS,
    PLACED_STRAY_MAX_M,
    RANGE_VARIANCE_MIN_M2,
    ROOT_CORRELATION_MAX,
    SWITCH_LEAD_NAT,
    SWITCH_ROOT_M,
    SWITCH_UNSEEN,
    TENTATIVE_FIT_STEPS,
    TRACK_FIT_STEPS,
    TRACK_READINGS_MIN,
    UNSURE_ROOT_M,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import (
    CONFIRMED,
    ESTABLISHED,
    PLACED,
    TENTATIVE,
    CircleTrack,
    CircleTracks,
    StateRecord,
)
from perception.bayes.tracks.model_check import check_model, count_names, is_careful
from perception.bayes.tracks.naming import update_name, withdraw_overlapping
from perception.bayes.tracks.track_selection import choose_circle, is_waiting
from perception.kernel import entry_kernel, kernel
from perception.shared_numbers import CERTAIN_PROBABILITY


@kernel
def fit_start(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> None:
    """Move a track to its robust fit where the two lie far apart or the track is young.

    Parameters
    ----------
    s, p, track, n
        As for `locate_circle`.
    """
    fit = s[0].scratch.circle_fit
    noise = noise_variance(s, p)
    steps = TENTATIVE_FIT_STEPS if track.status == TENTATIVE else TRACK_FIT_STEPS
    if not fit_circle(
        s[0].scratch.readings[:n],
        (track.x, track.y, track.radius),
        p,
        FIT_SOFTNESS,
        noise,
        steps,
        s[0].scratch.predicted,
        fit,
    ):
        return
    h00, h01, h11 = fit.information_xx, fit.information_xy, fit.information_yy
    det = h00 * h11 - h01 * h01
    dx = fit.x - track.x
    dy = fit.y - track.y
    if det > 0.0 and (
        h00 * dx * dx + 2.0 * h01 * dx * dy + h11 * dy * dy > FIT_LEAD_SIGMAS2
        or track.refinements <= FITTED_REFINEMENTS
    ):
        track.x = fit.x
        track.y = fit.y
        c00 = min(h11 / det, CENTRE_VARIANCE_MAX_M2)
        c11 = min(h00 / det, CENTRE_VARIANCE_MAX_M2)
        limit = ROOT_CORRELATION_MAX * math.sqrt(c00 * c11)
        track.root_xx = math.sqrt(c00)
        track.root_yx = min(limit, max(-limit, -h01 / det)) / track.root_xx
        track.root_yy = math.sqrt(max(c11 - track.root_yx**2, RANGE_VARIANCE_MIN_M2))


@kernel
def locate_circle(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> None:
    """Update a track's position, mean and covariance, by a robust fit and a search across the beam.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : CircleTrack
        Updated.
    n : int
        Its readings, the first of the scratch.
    """
    fit_start(s, p, track, n)
    if max(track.root_xx, track.root_yy) > UNSURE_ROOT_M and search_across(s, p, track, n):
        track.root_xx = max(track.root_xx, LATERAL_STEP_M)
        track.root_yy = max(track.root_yy, LATERAL_STEP_M)
    x = track.x
    y = track.y
    scratch = s[0].scratch
    posterior = scratch.posterior
    posterior.x = x
    posterior.y = y
    posterior.root_xx = track.root_xx
    posterior.root_yx = track.root_yx
    posterior.root_yy = track.root_yy
    posterior_circle(
        scratch.readings[:n], track.radius, p, s[0].noise_level, scratch.predicted, scratch.linear, scratch.cells,
        posterior,
    )  # fmt: skip
    track.x = posterior.x
    track.y = posterior.y
    track.root_xx = posterior.root_xx
    track.root_yx = posterior.root_yx
    track.root_yy = posterior.root_yy
    track.covariance_xx = posterior.covariance_xx
    track.covariance_xy = posterior.covariance_xy
    track.covariance_yy = posterior.covariance_yy
    unsure = max(track.root_xx, track.root_yy) > UNSURE_ROOT_M
    if unsure and score(s, p, n, x, y, track.radius) > score(s, p, n, track.x, track.y, track.radius) + LOST_NAT:
        track.x = x
        track.y = y


@kernel
def update_score(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int) -> float:
    """Update a track's evidence and what it predicts; return its log prior as a model, nat.

    Parameters
    ----------
    s, p, track, n
        As for `locate_circle`.
    """
    scratch = s[0].scratch
    said = scratch.score
    score_circle(scratch.readings[:n], track.x, track.y, track.radius, p, s[0].noise_level, scratch.own, said)
    track.log_likelihood_ratio = said.log_likelihood_ratio
    track.hits = said.hits
    track.misses = said.misses
    track.near = said.near
    track.unknown_nat = p[0].unknown_nat * said.near
    track.dispersion = said.dispersion
    track.leads[track.kind] = 0.0
    beyond: float = max(0.0, said.closest - p[0].far_m)
    return p[0].model_prior_nat - p[0].far_nat_per_m * beyond


@kernel
def change_kind(s: StateRecord, p: SettingsRecord, track: CircleTrack, k: int, evidence_nat: float) -> None:
    """Change a track to another circle that explains it better.

    Parameters
    ----------
    s, p
        Memory, whose scratch holds the other circle's fit, and settings.
    track : CircleTrack
        Updated.
    k : int
        Index of the other circle.
    evidence_nat : float
        Its log ratio.
    """
    track.x = s[0].scratch.circle_fit.x
    track.y = s[0].scratch.circle_fit.y
    track.radius = p[0].circles[k].radius_m
    for z in range(p[0].circle_count + 2):
        track.leads[z] += track.log_likelihood_ratio - evidence_nat
    track.kind = k
    track.leads[k] = 0.0
    track.outline_lead = 0.0
    track.round_lead = 0.0
    track.log_likelihood_ratio = evidence_nat
    track.refinements = 0
    track.unseen += SWITCH_UNSEEN
    track.root_xx = max(track.root_xx, SWITCH_ROOT_M)
    track.root_yy = max(track.root_yy, SWITCH_ROOT_M)


@kernel
def compare_alternatives(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int, prior: float) -> bool:
    """Compare the next alternatives; return whether the track is still an object and not a line.

    `leads` holds the lead of each at its last comparison. (Log ratios of different ages cannot be compared: the
    readings have changed in between.)

    Parameters
    ----------
    s, p, track, n
        As for `locate_circle`.
    prior : float
        From `update_score`.
    """
    line, corner = p[0].circle_count, p[0].circle_count + 1
    var0, rel2 = noise_variance(s, p)
    scratch = s[0].scratch
    bearing = mean_bearing(scratch.readings[:n], scratch.own, track.x, track.y, p[0].gate_m)
    turns = corner + 1 if n < p[0].compare_all_below and track.probability < CERTAIN_PROBABILITY else 1
    for _ in range(turns):
        track.alternative = (track.alternative + 1) % (corner + 1)
        if track.alternative == track.kind:
            track.alternative = (track.alternative + 1) % (corner + 1)
        k = track.alternative
        circle = (track.x, track.y, track.radius)
        own_prior = prior if track.kind < p[0].model_count else 0.0
        if k < line:
            v = fit_other_circle(s, p, n, circle, bearing, p[0].circles[k].radius_m, OTHER_FIT_STEPS)
            track.leads[k] = v - track.log_likelihood_ratio
            leads = (
                v + (prior if k < p[0].model_count else 0.0)
                > track.log_likelihood_ratio + own_prior + SWITCH_LEAD_NAT
            )
            if leads and may_become(s, track, k, v):
                change_kind(s, p, track, k, v)
                predict_circle(scratch.readings[:n], track.x, track.y, track.radius, scratch.own)
                break
        elif k == line:
            v = fit_other_line(s, p, n, circle, bearing, OTHER_FIT_STEPS)
            track.leads[k] = v - track.log_likelihood_ratio
            if v > track.log_likelihood_ratio + max(prior, 0.0) + SWITCH_LEAD_NAT:
                return False
        else:
            v = score_corner(s, p, n, track.x, track.y, track.radius, var0, rel2)
            track.leads[k] = v + CORNER_MISS_SHARE * p[0].missed_echo_nat * track.misses - track.log_likelihood_ratio
    return True


@kernel
def existence_probability(p: SettingsRecord, track: CircleTrack, prior: float) -> float:
    """Return the probability of a track's explanation among all: radii, line, corner, other bodies, nothing.

    Parameters
    ----------
    p
        Settings.
    track : CircleTrack
        The track.
    prior : float
        From `update_score`.
    """
    kind = track.kind
    line = p[0].circle_count
    own_prior = prior if kind < p[0].model_count else 0.0
    own = track.log_likelihood_ratio + own_prior
    total = 1.0 + bounded_exp(-own) + bounded_exp(track.unknown_nat + p[0].model_prior_nat - own)
    if kind < p[0].model_count:
        total += other_bodies(track, p)
    for k in range(line + 2):
        if k != kind and track.leads[k] != 0.0:
            lead = prior if k < p[0].model_count else (p[0].model_prior_nat + LINE_PRIOR_NAT if k == line else 0.0)
            total += bounded_exp(track.leads[k] + lead - own_prior)
    return 1.0 / total


@kernel
def update_circle_status(track: CircleTrack, p: SettingsRecord) -> None:
    """Establish a track that is probable and well located; make an improbable one tentative again."""
    if track.status == TENTATIVE and track.probability > ESTABLISH_PROBABILITY and track.hits >= ESTABLISH_HITS:
        if track.dispersion >= p[0].dispersion_min and max(track.root_xx, track.root_yy) < ESTABLISH_ROOT_M:
            track.status = ESTABLISHED
    elif track.status == ESTABLISHED and (
        track.probability < DOUBT_PROBABILITY or track.dispersion < DOUBTED_DISPERSION_SHARE * p[0].dispersion_min
    ):
        track.status = TENTATIVE


@kernel
def refine(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, t: int) -> None:
    """Refine track `t`: pose, evidence, alternatives, noise, probability and status."""
    track = tracks[t]
    n = copy_reservoir(track, s[0].scratch.readings)
    n = add_crosses(s, p, track.x, track.y, track.radius, s[0].scratch.readings, n)
    assume_rays(s, p, s[0].rays)
    n = keep_relevant(s, tracks, p, n, track.x, track.y, track.radius, t)
    track.reservoir = n
    track.unseen = 0
    track.refinements += 1
    s[0].refinements += 1
    if n < TRACK_READINGS_MIN:
        drop_track(track)
        return
    x, y = track.x, track.y
    locate_circle(s, p, track, n)
    if track.marks & PLACED and math.hypot(track.x - x, track.y - y) > PLACED_STRAY_MAX_M:
        track.x = x  # Another body's echoes lead there.
        track.y = y
    prior = update_score(s, p, track, n)
    if not compare_alternatives(s, p, track, n, prior) and drop_track(track):
        return
    if s[0].rays > 0:
        compare_rays(s, p, track, n)
    careful = is_careful(s, tracks, p)
    add_residuals(s, tracks, p, t, n, careful)
    is_due = track.is_named == 0 or track.refinements % MODEL_CHECK_EVERY == 0
    if track.kind < p[0].model_count and is_due:
        track.outline_lead = outline_lead(s, p, track, n)
        track.round_lead = round_lead(s, p, n)
    track.probability = existence_probability(p, track, prior)
    evidence = track.log_likelihood_ratio
    if (evidence < 0.0 or evidence < track.unknown_nat - SWITCH_LEAD_NAT) and drop_track(track):
        return
    update_circle_status(track, p)
    if track.status == ESTABLISHED and track.kind < p[0].model_count and is_due:
        check_model(s, p, track, n)
    report = p[0].report_probability
    near = p[0].report_probability_near if prior >= p[0].model_prior_nat else report
    update_name(track, p, report, near, careful, s[0].room.stop.is_standing == 1)
    withdraw_overlapping(tracks, t)
    if track.is_named == 1:
        track.marks &= CONFIRMED
    elif track.marks != 0:
        hold(track, x, y)
    merge_duplicates(tracks, p, t)


@entry_kernel
def quantum(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, threshold: float) -> bool:
    """Refine the circle that is next; return whether another circle waits.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    threshold : float
        Unseen evidence for an object's size from which on it waits for refinement.
    """
    t = choose_circle(s, tracks, p, threshold)
    if t >= 0:
        track = tracks[t]
        if track.idle_firings > p[0].idle_firings:
            track.final_refinements -= 1
        was_named, x, y = track.status == ESTABLISHED and track.is_named == 1, track.x, track.y
        refine(s, tracks, p, t)
        if s[0].rays > 0:
            decide_rays(s, tracks, p)
        if was_named:
            count_names(s, tracks, p, t, x, y)
    return is_waiting(tracks, p, threshold)
