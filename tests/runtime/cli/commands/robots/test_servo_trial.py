"""Sensors on servos in `ring-test`: what is wrong with one is named, and an honest one is good."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_robot, load_settings
from config.robot import RingConfig
from drivers.messages import Floats
from runtime.cli.commands.robots.ring_trial import RingTest, with_single_firing
from runtime.cli.commands.robots.servo_trial import hands_before, judge_servo_hands, stuck_servos

TURNING = load_robot("servo1").ring
TO_AND_FRO = RingConfig.model_validate(
    {
        "sensors": [{"x_m": 0.0, "y_m": 0.0, "angle_deg": 0.0, "servo": True, "bearings": 13}],
        "beam_half_angle_deg": 15.0,
        "resolution_m": 0.003,
        "range_min_m": 0.02,
        "range_max_m": 4.0,
        "firing": {"preset": "single"},
    }
)
RINGS = pytest.mark.parametrize("ring", [TURNING, TO_AND_FRO], ids=["turning", "to and fro"])
BEAM_RAD = math.radians(20.0)
FREE_M, HAND_M = 1.5, 0.2


def heard_at(ring: RingConfig, looks: Callable[[float], float]) -> list[list[int]]:
    """Return which bearings hear each hand, given where the sensor truly looks for a bearing that is asked for."""
    return [
        [
            k
            for k, mount in enumerate(ring.mounts)
            if abs(math.remainder(looks(mount.angle_rad) - hand.angle_rad, math.tau)) < BEAM_RAD
        ]
        for hand in hands_before(ring)
    ]


@RINGS
@pytest.mark.parametrize(
    ("looks", "said"),
    [
        (lambda a: a, None),
        (lambda a: a + math.radians(20.0), None),
        (lambda a: -a, "MIRRORED"),
        (lambda _: 9.0, "DOES NOT HEAR"),
        (lambda _: 0.0, "DOES NOT TURN"),
    ],
)
def test_what_hands_show_of_a_servo(ring: RingConfig, looks: Callable[[float], float], said: str | None) -> None:
    heard = heard_at(ring, looks) if said != "DOES NOT HEAR" else [[], []]
    lines = judge_servo_hands(ring, heard)
    assert [said in line for line in lines] == [True] if said else lines == []


def test_an_arm_that_is_put_on_turned_is_named() -> None:
    (line,) = judge_servo_hands(TURNING, heard_at(TURNING, lambda a: a + math.pi))
    assert "TURNED: sensor 0 looks 180 degrees away" in line
    (line,) = judge_servo_hands(TO_AND_FRO, heard_at(TO_AND_FRO, lambda a: a - math.radians(60.0)))
    assert "does not get there" in line


def test_one_range_all_round_is_named_and_a_wall_is_not() -> None:
    count = len(TURNING.mounts)
    assert stuck_servos(TURNING, [1.0, 1.003] * (count // 2))[0].startswith("ONE RANGE, 1.000 m")
    assert stuck_servos(TURNING, [1.0] * 7 + [math.inf] * (count - 7)) == {}
    assert stuck_servos(TURNING, [math.inf] * count) == {}
    assert stuck_servos(TURNING, np.linspace(0.5, 1.2, count).tolist()) == {}


@pytest.mark.parametrize("is_deaf", [False, True])
def test_the_hands_are_asked_for_and_heard(is_deaf: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    said, firings, asked_at, ring = list[str](), [0], list[int](), TO_AND_FRO
    count, hands = len(ring.mounts), hands_before(ring)

    def write(text: str) -> None:
        said.append(text)
        if text.startswith("hold "):
            asked_at.append(firings[0])

    async def exchange(_trial: RingTest) -> list[Floats]:
        firings[0] += 1
        turned = firings[0] % (2 * count)
        k, ranges = min(turned, 2 * count - 1 - turned), np.full(count, math.nan)
        off = abs(ring.mounts[k].angle_rad - hands[len(asked_at) - 1].angle_rad)
        is_held = 2 * count < firings[0] - asked_at[-1] < 8 * count
        ranges[k] = HAND_M if off < BEAM_RAD and is_held and not is_deaf else FREE_M
        return [ranges]

    monkeypatch.setattr(RingTest, "_exchange", exchange)
    config = load_settings("room", ("link.port=memory",), robot="servo1").model_copy(update={"ring": ring})
    trial = RingTest(with_single_firing(config), write, lambda: 0.01 * firings[0], ring)
    assert asyncio.run(trial._test_places([[FREE_M]] * count)) is not is_deaf
    assert [line.split(", ")[1] for line in said[:2]] == ["ahead (0 degrees) …\n", "to the left (90 degrees) …\n"]
    assert ("DOES NOT HEAR" if is_deaf else "each sensor answers in its place") in said[2]
