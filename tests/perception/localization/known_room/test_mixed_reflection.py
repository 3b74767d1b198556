"""The mixture of a reading's causes, against its formula for one reading; and how often each occurs, learned."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest

from perception.localization.known_room.mixed_reflection import (
    ROOMS,
    SHARES,
    SHARES_MAX,
    SHARES_MIN,
    LearnedShares,
    Shares,
    mixed_ratio,
    range_variance,
)
from perception.localization.known_room.surroundings import make_surroundings
from perception.localization.room.range_likelihood import RangeModel
from perception.localization.room.room import make_room
from perception.records import Records, records, zeros
from tests.naive_known_room import naive_causes, naive_ratio

MODEL = RangeModel(0.03, 5.0)
SENSOR = make_surroundings(make_room(np.array([[0.0, 0.0, 1.0, 0.0]])), MODEL, 0.2).sensor


def shares_of(values: tuple[float, ...]) -> Records[Shares]:
    """Shares as kernels take them."""
    memory = zeros(Shares, 1)
    memory[0] = values
    return records(Shares, memory)


@pytest.mark.parametrize("measured", [1.0, 1.1, 2.5, 4.0, math.inf])
@pytest.mark.parametrize("ranges", [(1.0, 1.0), (1.0, math.inf), (math.inf, 1.1), (math.inf, math.inf), (6.0, 7.0)])
@pytest.mark.parametrize("beside", [0.95, 6.0, math.inf])
def test_a_reading_has_one_of_its_causes(measured: float, ranges: tuple[float, float], beside: float) -> None:
    cone, specular = ranges
    shares = (0.3, 0.2, 0.1, 0.4)
    found, causes = mixed_ratio(SENSOR, measured, cone, 0.01, specular, 0.02, beside, 0.015, shares_of(shares))
    oracle = naive_causes(MODEL, measured, (cone, 0.01), (specular, 0.02), (beside, 0.015), shares)
    total = sum(oracle)
    smooth = oracle.mirror + oracle.beside + oracle.away + oracle.late
    assert found == pytest.approx(naive_ratio(MODEL, measured, oracle))
    assert causes[:3] == pytest.approx(tuple(weight / total for weight in oracle[:3]))
    assert causes[3:] == pytest.approx((
        smooth / total, (oracle.away + oracle.late) / total, oracle.late / total, oracle.wild / total,
        smooth / total if beside < 1.0 else 0.0,
    ))  # fmt: skip


def test_the_variance_is_the_range_models() -> None:
    for range_m in (0.2, 3.0, 9.0, math.inf):
        assert range_variance(SENSOR, range_m) == pytest.approx(float(MODEL.sigma(np.array(range_m))) ** 2)


def test_shares_are_learned_within_bounds() -> None:
    learned = LearnedShares()
    share = learned.records[0]
    assert learned.profiles().tolist() == [list(room[:3]) for room in ROOMS]
    learned.guess(1)
    assert (share.specular, share.late, share.wild, share.beside) == ROOMS[1]
    for _ in range(300):
        learned.learn(
            SimpleNamespace(specular=8.0, turned_away=4.0, late=1.0, wild=2.0, beside=1.5, could_beside=3.0), 10
        )
    assert (share.specular, share.late, share.wild, share.beside) == pytest.approx((0.8, 0.25, 0.2, 0.5), abs=0.01)
    for causes, bounds in ((0.0, SHARES_MIN), (10.0, SHARES_MAX)):
        for _ in range(300):
            learned.learn(
                SimpleNamespace(
                    specular=causes, turned_away=10.0, late=causes, wild=causes, beside=causes, could_beside=10.0
                ),
                10,
            )
        assert (share.specular, share.late, share.wild, share.beside) == pytest.approx(bounds)
    assert learned.profiles().tolist() == [[share.specular, share.late, share.wild]]
    learned.guess(0)
    assert share.specular == SHARES_MAX[0], "what was learned is not guessed"
    learned.reset()
    assert len(learned.profiles()) == len(ROOMS)
    assert (share.specular, share.late, share.wild, share.beside) == SHARES
