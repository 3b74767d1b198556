"""The best poses of a search: apart from each other, and no more than fit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.localization.known_room.pose_starts import START_APART_M, STARTS_MAX, Starts, offer
from perception.records import array_of, records, zeros


def test_of_starts_side_by_side_the_best_is_kept_and_of_too_many_the_best() -> None:
    found = records(Starts, zeros(Starts, 1))
    scores = np.random.default_rng(0).permutation(STARTS_MAX + 50).astype(np.float64)
    for k, score in enumerate(scores.tolist()):
        offer(found, 1.0 * k, 0.0, 0.0, score, 0)
        offer(found, 1.0 * k + 0.9 * START_APART_M, 0.0, 2.0 * math.pi - 0.01, score - 0.5, 0)
        offer(found, 1.0 * k + 0.9 * START_APART_M, 0.0, 0.01, score + 0.5, 1)
    kept = array_of(found)["starts"][0]
    assert found[0].count == STARTS_MAX
    assert (kept["profile"] == 1).all()
    assert np.sort(kept["score"]) == pytest.approx(np.arange(50, STARTS_MAX + 50) + 0.5)
