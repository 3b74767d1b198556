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
    FREE,
    HIT,
    NAT,
    PLACES,
    STAMP,
    base_elsewhere,
    evidence_now,
    hit_nat,
    prior,
    renew,
)


def kept(base: int, hit: int = 0, free: int = 0, stamp: int = 1) -> np.ndarray:
    return np.array([base, hit, free, stamp], np.int16)


@given(st.integers(-CERTAIN, CERTAIN), st.integers(0, 5000), st.integers(-5000, 0), st.integers(1, PLACES - 1))
def test_evidence_is_bounded_and_never_changes_sign_by_fading(base: int, hit: int, free: int, place: int) -> None:
    at_once = evidence_now(kept(base, hit, free, place), place)
    assert at_once == min(CERTAIN, max(-CERTAIN, base + hit + free))
    later = evidence_now(kept(base, hit, free, place), (place + 500 * FADING_PLACES) % PLACES)
    assert abs(later) == max(0, abs(at_once) - 500)
    assert later * at_once >= 0


def test_a_new_place_keeps_what_was_found_and_the_same_place_changes_nothing() -> None:
    cell = kept(100, 300, -50, 7)
    renew(cell, 7)
    assert cell.tolist() == [100, 300, -50, 7]
    renew(cell, 107)
    assert (cell[BASE], cell[HIT], cell[FREE], cell[STAMP]) == (350 - 2, 0, 0, 107)


def test_evidence_from_other_directions_leaves_out_the_own_and_this_place() -> None:
    cell = np.stack([kept(10 * k, 1000, 0, 3) for k in range(9)])
    assert base_elsewhere(cell, 2, 3) == 70
    assert base_elsewhere(cell, 7, 3) == 60
    assert base_elsewhere(cell, 7, 4) == 1060


def test_an_echo_is_drawn_by_what_is_probable() -> None:
    assert prior(kept(0)) == pytest.approx(0.25)
    assert prior(kept(NAT, 3000, 0)) == pytest.approx((1.0 / (1.0 + math.exp(-1.0))) ** 2)
    assert hit_nat(0.0) == 0
    assert hit_nat(7.0) == hit_nat(1.0) == int(NAT * math.log(99.0))
