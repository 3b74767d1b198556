"""The lead of an unknown outline against its oracle, and on circles, barrels and boxes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from perception.bayes.circles import outline_check
from perception.bayes.inference.noise_estimation import noise_variance
from perception.bayes.memory.state import ESTABLISHED, Memory
from perception.kernel import Floats
from tests import naive_bayes, naive_naming
from tests.perception.bayes.random_tracks import (
    COSINES,
    NOISES,
    P,
    S,
    around,
    enter_readings,
    examples,
    new_memory,
    place_of,
    predict_own,
    random_track,
)

QUIET = int(np.argmin(np.hypot(NOISES[:, 0] - 0.0037, NOISES[:, 1] - 0.005)))
"""Index of a noise of .4 cm and .5 %."""
DRUM_M = 0.3048


def lead(memory: Memory, w: Floats) -> float:
    """Return the lead of an unknown outline over the first track on these readings."""
    enter_readings(memory, w)
    predict_own(memory, len(w), place_of(memory, 0), float(memory.tracks[0].radius))
    return float(outline_check.outline_lead(memory.s, P, memory.tracks[0], len(w)))


@examples(40, 400)
def test_the_leads_are_those_of_a_smooth_outline_and_of_another_radius(examples: int) -> None:
    rng, memory, led, none = np.random.default_rng(61), new_memory(), 0, 0
    larger = smaller = 0
    for _ in range(examples):
        memory.s[0].noise_level = int(rng.integers(len(NOISES)))
        random_track(rng, memory, 0, ESTABLISHED)
        centre, rho = place_of(memory, 0), float(memory.tracks[0].radius)
        w = around(rng, int(rng.choice([30, 200])), centre, rho)
        seen = naive_bayes.look(w, centre)
        if rng.random() < 0.5:
            w[:, 4] += 0.06 * np.cos(2.0 * np.arctan2(seen.u[:, 1], seen.u[:, 0]))
        found = lead(memory, w)
        radius = outline_check.round_lead(memory.s, P, len(w))
        e = w[:, 4] - (seen.d - rho)
        heard = (np.abs(e) <= S.gate_m) & (seen.cos >= COSINES[1]) & (seen.d - rho >= S.range_min_m)
        var0, rel2 = noise_variance(memory.s, P)
        bearings = np.arctan2(seen.u[heard, 1], seen.u[heard, 0])
        variances = var0 + rel2 * w[heard, 4] ** 2
        want = naive_naming.outline_lead(bearings, e[heard], variances)
        assert found == pytest.approx(want, rel=1e-9, abs=1e-9)
        other = naive_naming.round_lead(w[heard], centre, rho, variances)
        assert radius == pytest.approx(other, rel=1e-6, abs=1e-6)
        larger += other > 0.0
        smaller += other < 0.0
        none += want == 0.0
        led += want > 0.0
    assert none > 0
    assert min(led, larger, smaller) > 0


def box_distance(at: Floats, half: tuple[float, float]) -> float:
    """Return the distance of a point from an upright box about the origin, m."""
    return float(np.hypot(*np.maximum(np.abs(at) - half, 0.0)))


def drum_track() -> Memory:
    """Return a memory whose first track is a drum about the origin, with little noise."""
    memory = new_memory()
    memory.s[0].noise_level = QUIET
    track = memory.tracks[0]
    track.status, track.kind, track.radius = ESTABLISHED, 0, DRUM_M
    return memory


def look(rng: np.random.Generator, distance: Callable[[Floats], float], first_deg: float, n: int) -> Floats:
    """Return readings of a body from 120°, 1 to 2.5 m from the origin, with the Denning's rounding and .3 % noise."""
    rows = []
    for bearing in np.radians(rng.uniform(first_deg, first_deg + 120.0, n)).tolist():
        axis = np.array((math.cos(bearing), math.sin(bearing)))
        at = float(rng.uniform(1.0, 2.5)) * axis
        heard = round(distance(at) * (1.0 + rng.normal(0.0, 0.003)) / 0.03048) * 0.03048
        rows.append((*at, *-axis, heard))
    return np.array(rows)


def test_a_box_of_a_drums_size_is_no_drum() -> None:
    rng, memory = np.random.default_rng(62), drum_track()
    for first in range(0, 360, 30):
        assert lead(memory, look(rng, lambda at: math.hypot(*at) - DRUM_M, first, 120)) < -3.0
        for half in ((0.32, 0.24), (0.19, 0.32)):
            seen = look(rng, lambda at, half=half: box_distance(at, half), first, 120)  # type: ignore[misc]
            assert lead(memory, seen) > 10.0


def test_a_round_body_between_a_drum_and_a_rival_is_no_drum() -> None:
    """Its front is where the drum's would be, so that only its curvature differs."""
    rng, memory = np.random.default_rng(64), drum_track()
    for radius, is_drum in ((DRUM_M, True), (0.19, False), (0.45, False)):
        shift = np.array((DRUM_M - radius, 0.0))
        w = look(rng, lambda at, r=radius, c=shift: math.hypot(*(at - c)) - r, -60.0, 120)  # type: ignore[misc]
        enter_readings(memory, w)
        predict_own(memory, len(w), place_of(memory, 0), DRUM_M)
        found = outline_check.round_lead(memory.s, P, len(w))
        assert found < -1.5 if is_drum else found > 3.0, (radius, found)


def test_few_bearings_tell_nothing_of_the_outline() -> None:
    rng, memory = np.random.default_rng(63), new_memory()
    random_track(rng, memory, 0, ESTABLISHED)
    memory.tracks[0].x = memory.tracks[0].y = 0.0
    axis = np.array((1.0, 0.0))
    w = np.tile((*(2.0 * axis), *-axis, 2.0 - float(memory.tracks[0].radius) + 0.05), (20, 1))
    assert lead(memory, w) == 0.0
