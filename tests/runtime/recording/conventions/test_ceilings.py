"""Noisy silence is a band at the top of the ranges, also where its noise is cut off."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from runtime.recording.conventions.ceilings import cut_off, find_band, lone_bands, lone_readings
from tests.runtime.recording.conventions.silence_tables import KINDS, outcome, silence_table


@pytest.mark.parametrize("above", [-1.0, 0.0, 0.5])
def test_noise_that_is_cut_off_at_the_greatest_value_is_measured(above: float) -> None:
    """`above` is the true mean over the greatest value, in standard deviations."""
    rng = np.random.default_rng(1)
    silent = np.minimum(5.0 + 0.05 * (above + rng.standard_normal(4000)), 5.0)
    found = cut_off(np.concatenate([silent, rng.uniform(4.4, 5.0, 300)]))
    assert found == pytest.approx((5.0 + 0.05 * above, 0.05), abs=0.006)


def test_one_exact_value_among_ranges_has_no_noise() -> None:
    rng = np.random.default_rng(2)
    assert cut_off(np.concatenate([np.full(900, 5.0), rng.uniform(4.4, 5.0, 300)])) is None
    assert cut_off(np.full(900, 5.0)) is None


def test_a_rare_band_is_found_beside_ranges() -> None:
    rng = np.random.default_rng(3)
    found = find_band(np.concatenate([rng.uniform(0.3, 4.4, 2000), 4.9 + 0.05 * rng.standard_normal(90)]), 0.03)
    assert found is not None
    assert (found.centre, found.spread) == pytest.approx((4.9, 0.05), abs=0.02)


def test_lone_readings_agree_with_neither_neighbour() -> None:
    walls = np.column_stack([np.linspace(4.0, 3.0, 60), np.linspace(1.0, 2.0, 60)])
    walls[7, 0] = walls[20, 1] = 4.9
    walls[30:32, 1] = 4.9  # repeated
    np.testing.assert_allclose(lone_readings(walls), 4.9)
    assert len(lone_readings(walls)) == 3


def test_a_band_among_far_walls_shows_in_lone_readings() -> None:
    rng = np.random.default_rng(4)
    band = 4.8 + 0.03 * rng.standard_normal(60)
    finite = np.concatenate([rng.uniform(1.0, 4.6, 1200), band, rng.uniform(4.6, 4.85, 20)])
    lone = np.concatenate([finite[:40], band[:30]])
    found, _ = lone_bands(lone, finite)
    assert found is not None
    assert found.centre == pytest.approx(4.8, abs=0.02)
    assert lone_bands(finite[:70], finite) == (None, None)


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.soak)])
@pytest.mark.parametrize("kind", KINDS)
def test_silence_that_is_hard_to_see_is_never_wrong_without_a_word(kind: str, seed: int) -> None:
    word, _ = found = outcome(silence_table(kind, seed))
    assert word != "wrong", found


def test_a_noisy_wall_that_ends_at_the_greatest_range_is_no_silence() -> None:
    """At one angle to the way, 20 echoes were rounded to 5.00 m and 6 to 4.99 m; farther ones were not heard."""
    word, _ = found = outcome(silence_table("noisy-corridor", 6035))
    assert word == "right", found


@pytest.mark.soak
def test_many_tables_whose_silence_is_hard_to_see() -> None:
    """Of walls in a corridor and rooms of echoes alone, none is refused for its silence."""
    found = Counter((kind, outcome(silence_table(kind, seed))[0]) for kind in KINDS for seed in range(1000, 1040))
    assert sum(found[kind, "wrong"] for kind in KINDS) == 0, found
    assert sum(found[kind, "refused"] for kind in KINDS) <= 12, found
