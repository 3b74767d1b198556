"""Alternative explanations of a polygon's readings: a wall, a round object, an unknown object."""

from __future__ import annotations

import math

from perception.bayes.inference.beam import assume_rays
from perception.bayes.inference.likelihood import bounded_exp
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.inference.range_fit import fit_circle, score_circle
from perception.bayes.memory.parameters import FIT_SOFTNESS, OTHER_FIT_STEPS, SWITCH_LEAD_NAT
from perception.bayes.memory.polygon_parameters import (
    POLYGON_AROUND_M,
)
from perception.bayes.memory.settings_record import SettingsRecord
from perception.bayes.memory.state import ESTABLISHED, FREE, CircleTracks, PolygonTrack, StateRecord
from perception.kernel import kernel


@kernel
def evidence_of_circles(s: StateRecord, p: SettingsRecord, track: PolygonTrack) -> float:
    """Return the log ratio (nat, prior included) of the circle that best explains the job's readings.

    An edge, a post or a drum seen from a few places looks like a polygon's corner, and the circle track in that place
    may have ended. So circles are scored on the same readings that support the polygon.

    Parameters
    ----------
    s, p
        Memory and settings.
    track : PolygonTrack
        The polygon in whose place circles are fitted.
    """
    scratch = s[0].scratch
    readings = s[0].job_readings[: s[0].job.reading_count]
    outline = p[0].polygons[track.model]
    x = track.x
    y = track.y
    ux = 0.0
    uy = 0.0
    for j in range(len(readings)):
        q = readings[j]
        dx = x - q.x
        dy = y - q.y
        d = math.hypot(dx, dy)
        if d > 0.0 and abs(q.range_m - d) < outline.outer_radius_m:
            ux += dx / d
            uy += dy / d
    length = math.hypot(ux, uy)
    if length == 0.0:
        return -math.inf
    var0, rel2 = noise_variance(s, p)
    assume_rays(s, p, s[0].rays)
    best = -math.inf
    for k in range(p[0].circle_count):
        radius = p[0].circles[k].radius_m
        behind = (radius - outline.inner_radius_m) / length
        if fit_circle(
            readings,
            (x + behind * ux, y + behind * uy, radius),
            p,
            FIT_SOFTNESS,
            (var0, rel2),
            OTHER_FIT_STEPS,
            scratch.predicted,
            scratch.circle_fit,
        ):
            score_circle(
                readings,
                scratch.circle_fit.x,
                scratch.circle_fit.y,
                radius,
                p,
                s[0].job.noise_level,
                scratch.predicted,
                scratch.score,
            )
            prior = p[0].model_prior_nat if k < p[0].model_count else 0.0
            best = max(best, scratch.score.log_likelihood_ratio + prior)
    return best


@kernel
def compare_circles(s: StateRecord, tracks: CircleTracks, p: SettingsRecord, track: PolygonTrack) -> None:
    """Update a polygon's probability against nothing, an unknown object and the circles in its place.

    Circles that are far less likely than an established polygon are removed.
    """
    own = track.log_likelihood_ratio + p[0].model_prior_nat
    around = p[0].polygons[track.model].outer_radius_m + POLYGON_AROUND_M
    total = 1.0 + bounded_exp(-own)
    total += bounded_exp(p[0].unknown_polygon_nat * track.near + p[0].model_prior_nat - own)
    total += bounded_exp(evidence_of_circles(s, p, track) - own)
    for k in range(len(tracks)):
        circle = tracks[k]
        if circle.status != FREE and math.hypot(circle.x - track.x, circle.y - track.y) < around:
            prior = p[0].model_prior_nat if circle.kind < p[0].model_count else 0.0
            v = circle.log_likelihood_ratio + prior
            if v < own - SWITCH_LEAD_NAT and track.status == ESTABLISHED and circle.marks == 0:
                circle.status = FREE
            elif circle.status == ESTABLISHED:
                total += bounded_exp(v - own)
    track.probability = 1.0 / total
