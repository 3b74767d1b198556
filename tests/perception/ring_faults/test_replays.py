"""Whether a ring replays old readings: what changes to the bit as before, and what honest rings repeat."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import pytest

from perception.ring_faults.memory import NO_ECHO_M
from perception.ring_faults.motion_tests import REPLAY_NAT
from perception.ring_faults.replays import PAST_FIELDS, PAST_LOOKS, PastLooks, weigh_replay

SENSORS = 8
HALF, TOLERANCE = math.radians(15.0), 0.005
STEP_M = 0.1


class Ring:
    """What is remembered of a ring, and the greatest evidence so far."""

    def __init__(self) -> None:
        self.past = np.zeros((SENSORS, PAST_LOOKS, PAST_FIELDS))
        self.looks, self.nats = np.zeros(SENSORS, np.int64), np.zeros(PAST_LOOKS)
        self.before = np.full(SENSORS, NO_ECHO_M)
        self.most = 0.0

    def hear(self, rounds: Iterable[np.ndarray], step_m: float = STEP_M) -> float:
        """Return the greatest evidence of a round, nat."""
        for ranges in rounds:
            for i, r in enumerate(ranges.tolist()):
                x = step_m * int(self.looks[i])
                nats = weigh_replay(
                    i,
                    (r, x, 0.0, 0.0),
                    float(self.before[i]),
                    (HALF, TOLERANCE, 5.0),
                    PastLooks(self.past, self.looks, self.nats),
                )
                self.most = max(self.most, float(nats))
            self.before[:] = ranges
        return self.most


def drive(rounds: int, seed: int, step: float = 0.001) -> list[np.ndarray]:
    """Return noisy ranges that become shorter ahead and longer behind, in whole steps, a tenth of them silent."""
    rng = np.random.default_rng(seed)
    axes = 2.0 * np.pi * np.arange(SENSORS) / SENSORS
    start = rng.uniform(1.0, 4.0, SENSORS)
    found = []
    for k in range(rounds):
        ranges = np.abs(start - STEP_M * k * np.cos(axes)) * rng.normal(1.0, 0.01, SENSORS)
        ranges = np.round(ranges / step) * step
        found.append(np.where(rng.random(SENSORS) < 0.1, NO_ECHO_M, ranges))
    return found


@pytest.mark.parametrize("period", [2, 5, 7, 20, PAST_LOOKS - 1])
@pytest.mark.parametrize("seed", range(3))
def test_a_sequence_that_returns_is_found_in_its_second_round(period: int, seed: int) -> None:
    ring = Ring()
    old = drive(period, seed)
    assert ring.hear(old) < 0.5 * REPLAY_NAT
    assert ring.hear(old + old) > REPLAY_NAT
    assert int(ring.nats.argmax()) % period == 0


@pytest.mark.parametrize("step", [0.001, 0.03048])
@pytest.mark.parametrize("seed", [*range(4), *(pytest.param(k, marks=pytest.mark.soak) for k in range(4, 20))])
def test_an_honest_drive_has_little_evidence_against_it(seed: int, step: float) -> None:
    assert Ring().hear(drive(400, seed, step)) < 0.6 * REPLAY_NAT


def test_what_stands_still_and_what_never_changes_is_no_replay() -> None:
    old = drive(5, 1)
    assert Ring().hear(old * 4, step_m=0.0) == 0.0
    assert Ring().hear([np.full(SENSORS, 2.0)] * 40) == 0.0
    assert Ring().hear([np.full(SENSORS, NO_ECHO_M)] * 40) == 0.0


def test_a_stuck_sensor_says_nothing_and_a_reading_that_differs_counts_against_it() -> None:
    stuck = drive(60, 2)
    for ranges in stuck:
        ranges[3] = 1.0
    assert Ring().hear(stuck) < 0.6 * REPLAY_NAT
    ring, old = Ring(), drive(5, 3)
    ring.hear(old + old)
    before = float(ring.nats[5])
    ring.hear(drive(1, 4))
    assert ring.nats[5] < before
