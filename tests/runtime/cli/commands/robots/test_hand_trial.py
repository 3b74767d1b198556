"""A hand before each sensor: what is exchanged, turned or deaf is named, and an honest ring is good."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_robot, load_settings
from config.robot import RingConfig
from drivers.messages import Floats
from runtime.cli.commands.robots.hand_trial import HandWatch, held_m, judge_hands, side_of
from runtime.cli.commands.robots.ring_trial import RingTest, with_single_firing

FRONT = (30.0, 0.0, -30.0)
BASE = {"beam_half_angle_deg": 15.0, "resolution_m": 0.003, "range_min_m": 0.02, "range_max_m": 4.0}
FRONT3 = RingConfig.model_validate(
    BASE
    | {
        "sensors": [
            {"x_m": 0.09 * math.cos(math.radians(a)), "y_m": 0.09 * math.sin(math.radians(a)), "angle_deg": a}
            for a in FRONT
        ],
        "firing": {"preset": "single"},
    }
)
RING4 = RingConfig.model_validate(BASE | {"count": 4, "radius_m": 0.09, "firing": {"preset": "opposite_pairs"}})
FREE_M, HAND_M = 1.5, 0.2
COMES, GOES = 3, 9
"""The hand comes and goes so many firings after it was asked for."""


def outcome(
    ring: RingConfig, heard_by: Callable[[int], int | None], monkeypatch: pytest.MonkeyPatch
) -> tuple[bool, list[str]]:
    """Return whether all is good, and the lines of findings, given which sensor hears a hand in whose place."""
    said, firings, asked_at = list[str](), [0], list[int]()

    def write(text: str) -> None:
        if text.startswith("hold "):
            asked_at.append(firings[0])
        else:
            said.append(text)

    async def exchange(_trial: RingTest) -> list[Floats]:
        firings[0] += 1
        ranges = np.full(len(ring.mounts), FREE_M)
        if COMES <= firings[0] - asked_at[-1] < GOES:
            heard = heard_by(len(asked_at) - 1)
            if heard is not None:
                ranges[heard] = HAND_M
        return [ranges]

    monkeypatch.setattr(RingTest, "_exchange", exchange)
    config = load_settings("room", ("link.port=memory",), robot="servo1").model_copy(update={"ring": ring})
    trial = RingTest(with_single_firing(config), write, lambda: 0.1 * firings[0], ring)
    return asyncio.run(trial._test_places([[FREE_M]] * len(ring.mounts))), said


@pytest.mark.parametrize("ring", [FRONT3, RING4], ids=["front", "ring"])
def test_an_honest_ring_is_good(ring: RingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    assert outcome(ring, lambda place: place, monkeypatch) == (True, ["each sensor answers in its place\n"])


@pytest.mark.parametrize("ring", [FRONT3, RING4], ids=["front", "ring"])
def test_exchanged_wires_are_named(ring: RingConfig, monkeypatch: pytest.MonkeyPatch) -> None:
    is_good, lines = outcome(ring, lambda place: {0: 2, 2: 0}.get(place, place), monkeypatch)
    assert not is_good
    assert [line.split(":")[0] for line in lines] == ["EXCHANGED", "EXCHANGED"]
    assert "is heard by sensor 2, and sensor 0 belongs there: exchange their wires" in lines[0]


def test_a_ring_mounted_the_other_way_round_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    is_good, lines = outcome(RING4, lambda place: (place + 2) % 4, monkeypatch)
    assert not is_good
    assert "TURNED: the ring is mounted turned by 180 degrees" in lines[0]
    is_good, lines = outcome(FRONT3, lambda _: None, monkeypatch)
    assert not is_good
    assert "NO SENSOR heard the hand: the ring is mounted the other way round" in lines[0]


def test_a_sensor_that_never_hears_an_echo_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    is_good, lines = outcome(FRONT3, lambda place: None if place == 1 else place, monkeypatch)
    assert not is_good
    assert "sensor 1 DOES NOT HEAR a hand ahead (0 degrees)" in lines[0]
    assert "and it reports 1.50 m: it looks elsewhere" in lines[0]
    (deaf,) = judge_hands(FRONT3, [0, None, 2], [FREE_M, math.inf, FREE_M])
    assert "sensor 1 DOES NOT HEAR a hand ahead (0 degrees): check its 5 V" in deaf
    assert "needs a divider" in deaf


def test_a_hand_is_held_where_the_sensor_can_hear_it() -> None:
    assert held_m(FRONT3) == pytest.approx((0.1, 0.3))
    assert held_m(load_robot("parking12").ring) == pytest.approx((0.3, 0.5))


def test_a_hand_counts_from_when_it_is_asked_for() -> None:
    watch = HandWatch([math.inf, 1.0], 0.3)
    watch.ask()
    assert [watch.take([0.2, math.nan]) for _ in range(3)] == [None, None, 0]
    watch.ask()
    assert watch.take([0.2, 1.0]) is None, "it is still there"
    assert [watch.take([math.inf, 0.3]) for _ in range(3)] == [None, None, 1]


def test_directions_are_said_in_words() -> None:
    assert side_of(0.0) == "ahead (0 degrees)"
    assert side_of(math.radians(91.0)) == "to the left (91 degrees)"
    assert side_of(math.radians(182.0)) == "behind (-178 degrees)"
    assert judge_hands(FRONT3, [0, 1, 2], [FREE_M] * 3) == []
