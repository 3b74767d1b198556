"""The bound of what one stand says against a case to check by hand."""

from __future__ import annotations

import numpy as np
import pytest

from bench.stand_bound import SIGMA_M, apart, audible_pairs
from config.load import load_robot

RING = load_robot("ears").ring


def test_a_body_is_not_apart_from_itself_and_farther_from_one_that_differs_more() -> None:
    t, heard = audible_pairs(RING, [(i, i) for i in range(24)], 1.2 + 0.0j)
    assert len(t) == 3
    assert t.tolist() == heard.tolist()
    assert apart(t, heard, 0.0, 1.2, 0.3, 0.3) == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < apart(t, heard, 0.0, 1.2, 0.0, 0.1) < apart(t, heard, 0.0, 1.2, 0.0, 0.3)


def test_three_echoes_differ_by_what_is_left_of_the_bend() -> None:
    t, heard = audible_pairs(RING, [(i, i) for i in range(24)], 1.2 + 0.0j)
    edge = abs(1.2 - t)
    drum = abs(1.5 - t) - 0.3
    bend = (edge - drum) - (edge - drum).mean()  # by symmetry only the range gives way
    assert apart(t, heard, 0.0, 1.2, 0.0, 0.3) == pytest.approx(float(np.linalg.norm(bend)) / SIGMA_M, rel=0.01)
