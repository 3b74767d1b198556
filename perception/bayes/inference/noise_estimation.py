"""Estimation of the ring's range noise.

There are two sources. *Roughness* needs no model: of three consecutive readings of one sensor the middle one should
lie between the outer two, on any surface. The *residuals* of sure objects discriminate far better, but only if the
objects are correct. So roughness decides which noises are possible, and both sources which one is likeliest. With
residuals alone a false object could raise the noise until it fits.
"""

from __future__ import annotations

import math

from perception.bayes.inference.likelihood import level_of, log_likelihood
from perception.bayes.memory.elements import Reading
from perception.bayes.memory.parameters import (
    CURVATURE_VARIANCE_M2,
    ELSEWHERE_PER_M,
    RANGE_VARIANCE_MIN_M2,
    RESIDUAL_EVERY,
    RESIDUAL_HITS_MIN,
    ROUGHNESS_MEMORY,
    SAME_SURFACE_SHARE,
    TRIPLE_MAX_M,
)
from perception.bayes.memory.settings_record import NOISES, Settings
from perception.bayes.memory.state import ESTABLISHED, CircleTrack, State
from perception.kernel import Floats, kernel
from perception.records import Records
from perception.shared_numbers import CERTAIN_PROBABILITY, FAR, OUTLIER_SIGMAS


@kernel
def noise_variance(s: Records[State], p: Records[Settings]) -> tuple[float, float]:
    """Return the assumed variance of a range r as (var0, rel2): var0 (m²) + rel2 · r²."""
    noise = p[0].noises[s[0].noise_level]
    return noise.absolute_m**2 + p[0].half_resolution_m ** 2 / 3.0 + RANGE_VARIANCE_MIN_M2, noise.relative**2


@kernel
def tolerance_m(half_box: float, var: float) -> float:
    """Return the greatest error of an explained range, m, for rounding ± `half_box` (m) and variance `var` (m²)."""
    return half_box + OUTLIER_SIGMAS * math.sqrt(var)


@kernel
def add_roughness(
    a: Reading, b: Reading, c: Reading, age_s: float, p: Records[Settings], evidence: Floats, is_moved: bool
) -> None:
    """Add the evidence of three readings of one sensor for each noise.

    Parameters
    ----------
    a, b, c : Reading
        The newest first.
    age_s : float
        Age of the oldest, s.
    p : (1,) Settings
        The noises.
    evidence : (NOISES,) float
        `State.roughness_nat`. Updated.
    is_moved : bool
        Whether readings are moved to where the ring jumped: then the ends of the ranges along the axis are compared.
    """
    if b.range_m >= FAR or c.range_m >= FAR or age_s > p[0].pair_gap_s:
        return
    ab = math.hypot(a.x - b.x, a.y - b.y)
    bc = math.hypot(b.x - c.x, b.y - c.y)
    ac = ab + bc
    if ac > TRIPLE_MAX_M or ac == 0.0:
        return
    share = bc / ac
    e = b.range_m - share * a.range_m - (1.0 - share) * c.range_m
    if is_moved:
        e += b.axis_x * (b.x - share * a.x - (1.0 - share) * c.x)
        e += b.axis_y * (b.y - share * a.y - (1.0 - share) * c.y)
    k = 1.0 + share * share + (1.0 - share) ** 2
    half_box = p[0].half_resolution_m
    for h in range(NOISES):
        noise = p[0].noises[h]
        var = (
            k * (noise.absolute_m**2 + (noise.relative * b.range_m) ** 2 + half_box**2 / 3.0) + CURVATURE_VARIANCE_M2
        )
        bell = SAME_SURFACE_SHARE * math.exp(-0.5 * e * e / var) / math.sqrt(math.tau * var)
        evidence[h] = evidence[h] * ROUGHNESS_MEMORY + math.log(bell + ELSEWHERE_PER_M)


@kernel
def add_residuals(
    s: Records[State], tracks: Records[CircleTrack], p: Records[Settings], t: int, n: int, careful: bool
) -> None:
    """Update each noise's evidence from the residuals of track `t`, if the track is sure.

    Parameters
    ----------
    s, tracks, p
        Memory and circles, updated, and settings.
    t : int
        The track, whose `n` readings are the first of the scratch, and what it predicts of them its `own`.
    n : int
        Readings.
    careful : bool
        Whether only the residuals of named objects count.
    """
    track = tracks[t]
    if track.status != ESTABLISHED or track.refinements % RESIDUAL_EVERY != 0 or track.kind >= p[0].model_count:
        return
    for h in range(NOISES):
        track.noise_nat[h] = 0.0
    if track.is_named == 0 and careful:
        return
    if track.probability < CERTAIN_PROBABILITY or track.hits < RESIDUAL_HITS_MIN:
        return
    own = s[0].scratch.own
    for j in range(n):
        e = own.error[j]
        if abs(e) < p[0].gate_m and own.ahead[j] >= p[0].cos_half_angle * own.distance[j]:
            for h in range(NOISES):
                track.noise_nat[h] += log_likelihood(p, level_of(p, h, s[0].scratch.readings[j].range_m), e)
    for h in range(NOISES):
        s[0].residuals_nat[h] = 0.0
        for k in range(len(tracks)):
            if tracks[k].status == ESTABLISHED:
                s[0].residuals_nat[h] += tracks[k].noise_nat[h]


@kernel
def choose_noise(s: Records[State], p: Records[Settings]) -> None:
    """Select the likeliest noise by both sources, among those that roughness does not exclude."""
    state = s[0]
    top = -1e300
    for h in range(NOISES):
        top = max(top, state.roughness_nat[h])
    best = -1e300
    for h in range(NOISES):
        v = state.roughness_nat[h] + state.residuals_nat[h]
        if state.roughness_nat[h] > top - p[0].roughness_gate_nat and v > best:
            best = v
            state.noise_level = h
