"""Comparison of a circle track with its alternatives: other radii, a line, a corner, and other numbers of rays."""

from __future__ import annotations

from perception.bayes.circles.alternatives import fit_other_circle, fit_other_line, mean_bearing
from perception.bayes.circles.corner_model import score_corner
from perception.bayes.inference.beam import assume_rays, next_rays
from perception.bayes.inference.lines import enter_line
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.prediction import predict_circle
from perception.bayes.inference.track_labels import may_become
from perception.bayes.memory.parameters import (
    ALTERNATIVE_STEPS,
    CERTAIN_PROBABILITY,
    CORNER_MISS_SHARE,
    LATERAL_LEAD_NAT,
    LINE_LENGTH_MIN_M,
    REPLACING_LINE_HITS_MIN,
    RESIDUAL_HITS_MIN,
    SWITCH_LEAD_NAT,
    SWITCH_ROOT_M,
    SWITCH_UNSEEN,
    TRACK_FIT_STEPS,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import CircleTrack, StateRecord
from perception.kernel import kernel


@kernel
def change_kind(s: StateRecord, p: SettingsRecord, track: CircleTrack, k: int, evidence_nat: float) -> None:
    """Change a track to another circle that explains it better, heard as the scratch says.

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
    track.rays = s[0].scratch.predicted.rays
    track.leads[k] = 0.0
    track.outline_lead = 0.0
    track.round_lead = 0.0
    track.log_likelihood_ratio = evidence_nat
    track.refinements = 0
    track.unseen += SWITCH_UNSEEN
    track.root_xx = max(track.root_xx, SWITCH_ROOT_M)
    track.root_yy = max(track.root_yy, SWITCH_ROOT_M)


@kernel
def explain(
    s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int, k: int, ux: float, uy: float, rays: int
) -> float:  # fmt: skip
    """Return the evidence (nat) of an alternative in its best place, heard by so many rays; the scratch has its fit.

    Parameters
    ----------
    s, p, track, n
        As for `refine.locate_circle`.
    k : int
        Which: index of a circle, or of the line or the corner behind them.
    ux, uy : float
        Mean bearing of the readings; see `mean_bearing`.
    rays : int
        As in `CircleTrack`.
    """
    line = p[0].circle_count
    assume_rays(s, p, rays)
    if k < line:
        return fit_other_circle(
            s, p, n, track.x, track.y, track.radius, ux, uy, p[0].circles[k].radius_m, ALTERNATIVE_STEPS
        )  # fmt: skip
    if k == line:
        return fit_other_line(s, p, n, track.x, track.y, track.radius, ux, uy, ALTERNATIVE_STEPS)
    var0, rel2 = noise_variance(s, p)
    v = score_corner(s, p, n, track.x, track.y, track.radius, var0, rel2)
    return v + CORNER_MISS_SHARE * p[0].missed_echo_nat * track.misses


@kernel
def compare_alternatives(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int, prior: float) -> bool:
    """Compare the next alternatives; return whether the track is still an object and not a line.

    `leads` holds the lead of each at its last comparison. (Log ratios of different ages cannot be compared: the
    readings have changed in between.) Each is heard as the track is, or as most objects here are.

    Parameters
    ----------
    s, p, track, n
        As for `refine.locate_circle`.
    prior : float
        From `refine.update_score`.
    """
    line, corner = p[0].circle_count, p[0].circle_count + 1
    scratch = s[0].scratch
    ux, uy = mean_bearing(scratch.readings[:n], scratch.own, track.x, track.y, p[0].gate_m)
    turns = corner + 1 if n < p[0].compare_all_below and track.probability < CERTAIN_PROBABILITY else 1
    for _ in range(turns):
        track.alternative = (track.alternative + 1) % (corner + 1)
        if track.alternative == track.kind:
            track.alternative = (track.alternative + 1) % (corner + 1)
        k = track.alternative
        own_prior = prior if track.kind < p[0].model_count else 0.0
        v = explain(s, p, track, n, k, ux, uy, s[0].rays)
        if track.rays != s[0].rays:
            here = v
            v = explain(s, p, track, n, k, ux, uy, track.rays)
            if here > v:
                v = explain(s, p, track, n, k, ux, uy, s[0].rays)
        track.leads[k] = v - track.log_likelihood_ratio
        if k < line:
            leads = (
                v + (prior if k < p[0].model_count else 0.0)
                > track.log_likelihood_ratio + own_prior + SWITCH_LEAD_NAT
            )
            if leads and may_become(s, track, k, v):
                change_kind(s, p, track, k, v)
                predict_circle(scratch.readings[:n], track.x, track.y, track.radius, scratch.own)
                break
        elif k == line and v > track.log_likelihood_ratio + max(prior, 0.0) + SWITCH_LEAD_NAT:
            said = scratch.line_score
            if said.hits >= REPLACING_LINE_HITS_MIN and said.high - said.low > LINE_LENGTH_MIN_M:
                enter_line(s, scratch.line_fit, track.x, track.y, said)
            return False
    assume_rays(s, p, track.rays)
    return True


@kernel
def compare_rays(s: StateRecord, p: SettingsRecord, track: CircleTrack, n: int, prior: float) -> None:
    """Compare a model heard by the next number of rays with a track, and let it take the track's place if it leads.

    Parameters
    ----------
    s, p, track, n
        As for `refine.locate_circle`.
    prior : float
        From `refine.update_score`.
    """
    scratch = s[0].scratch
    is_model = track.kind < p[0].model_count
    k = track.kind if is_model else 0
    track.other_rays = next_rays(track.other_rays, track.rays)
    ux, uy = mean_bearing(scratch.readings[:n], scratch.own, track.x, track.y, p[0].gate_m)
    assume_rays(s, p, track.other_rays)
    v = fit_other_circle(
        s, p, n, track.x, track.y, track.radius, ux, uy, p[0].circles[k].radius_m, TRACK_FIT_STEPS
    )  # fmt: skip
    if track.hits >= RESIDUAL_HITS_MIN:
        track.rays_compared += 1
    lead = v - track.log_likelihood_ratio + (0.0 if is_model or k >= p[0].model_count else prior)
    if lead > (LATERAL_LEAD_NAT if is_model else SWITCH_LEAD_NAT) and may_become(s, track, k, v):
        change_kind(s, p, track, k, v)
        track.leads[:] = 0.0
        track.rays_compared = 0
        predict_circle(scratch.readings[:n], track.x, track.y, track.radius, scratch.own)
    assume_rays(s, p, track.rays)
