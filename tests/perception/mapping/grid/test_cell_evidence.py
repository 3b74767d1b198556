"""The evidence of one cell: it fades, keeps the strongest of a place, and does not overflow."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from perception.mapping.grid.cell_evidence import (
    BASE,
    CERTAIN,
    FADING_PLACES,
    HIT,
    NAT,
    PASSAGE,
    PLACE_NUMBERS,
    STAMP,
    SURE,
    evidence_now,
    hit_nat,
    is_sure_elsewhere,
    make_draws,
    renew,
    without_hits,
)


def kept(base: int, hit: int = 0, free: int = 0, stamp: int = 1) -> np.ndarray:
    return np.array([base, hit, free, stamp], np.int16)


@given(st.integers(-CERTAIN, CERTAIN), st.integers(0, 5000), st.integers(-5000, 0), st.integers(1, PLACE_NUMBERS - 1))
def test_evidence_is_bounded_and_never_changes_sign_by_fading(base: int, hit: int, free: int, place: int) -> None:
    at_once = evidence_now(kept(base, hit, free, place), place)
    assert at_once == min(CERTAIN, max(-CERTAIN, base + hit + free))
    later = evidence_now(kept(base, hit, free, place), (place + 500 * FADING_PLACES) % PLACE_NUMBERS)
    assert abs(later) == max(0, abs(at_once) - 500)
    assert later * at_once >= 0


def test_a_new_place_keeps_what_was_found_and_the_same_place_changes_nothing() -> None:
    cell = kept(100, 300, -50, 7)
    renew(cell, 7)
    assert cell.tolist() == [100, 300, -50, 7]
    renew(cell, 107)
    assert (cell[BASE], cell[HIT], cell[PASSAGE], cell[STAMP]) == (350 - 2, 0, 0, 107)


@pytest.mark.parametrize("seed", range(5))
def test_a_cell_is_sure_elsewhere_by_its_other_directions_without_this_place(seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = set()
    for _ in range(200):
        place, base, hit = int(rng.integers(1, 900)), rng.integers(-SURE, SURE, 9), rng.integers(0, SURE, 9)
        stamps = np.where(rng.random(9) < 0.5, place, rng.integers(1, place + 1, 9))
        cell = np.column_stack([base, hit, rng.integers(-SURE, 1, 9), stamps]).astype(np.int16)
        own = int(rng.integers(0, 8))
        most = max(
            int(cell[k, BASE]) if cell[k, STAMP] == place else evidence_now(cell[k], place)
            for k in range(8)
            if k != own
        )
        planes, maybe_sure = cell.reshape(9, 1, 1, 4), np.ones((1, 1), np.bool_)
        for _ in range(2):  # whether the flag was lowered or not
            found.add(is_sure_elsewhere(planes, maybe_sure, 0, 0, own, place))
            assert is_sure_elsewhere(planes, maybe_sure, 0, 0, own, place) == (most >= SURE)
        assert maybe_sure[0, 0] or (cell[:8, BASE] + cell[:8, HIT]).max() < SURE
    assert found == {False, True}


def test_an_echo_is_drawn_by_what_is_probable() -> None:
    draws = make_draws()
    assert draws[CERTAIN + without_hits(kept(0))] == pytest.approx(0.25)
    assert draws[CERTAIN + without_hits(kept(NAT, 3000, 0))] == pytest.approx((1.0 / (1.0 + math.exp(-1.0))) ** 2)
    assert without_hits(kept(CERTAIN, 0, 0)) == len(draws) - 1 - CERTAIN
    assert without_hits(kept(-CERTAIN, 0, -7)) == -CERTAIN
    assert hit_nat(0.0) == 0
    assert hit_nat(7.0) == hit_nat(1.0) == int(NAT * math.log(99.0))
