"""Sensors on servos in `ring-test`: what is wrong with one is named, and an honest one is good."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable

import numpy as np
import pytest

from config.load import load_robot, load_settings
from config.robot import RingConfig, SensorConfig
from drivers.messages import Floats
from runtime.cli.commands.robots.ring_trial import RingTest, with_single_firing
from runtime.cli.commands.robots.servo_trial import hands_before, judge_servo_hands, not_shown_by_hands, stuck_servos

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
AMONG_FIXED = TO_AND_FRO.model_copy(
    update={
        "sensors": (
            *(TO_AND_FRO.sensors or ()),
            *(SensorConfig(x_m=0.0, y_m=0.0, angle_deg=angle) for angle in (90.0, -90.0)),
        )
    }
)
"""Beside the servo, whose sweep of 180 degrees overlaps their beams, fixed sensors to the left and right."""
RINGS = pytest.mark.parametrize("ring", [TURNING, TO_AND_FRO], ids=["turning", "to and fro"])
BEAM_RAD = math.radians(20.0)
FREE_M, HAND_M = 1.5, 0.2


def judged(ring: RingConfig, heard: list[list[int]]) -> list[str]:
    """Return what is wrong with sensors that heard nothing before."""
    return judge_servo_hands(ring, heard, [math.inf] * len(ring.mounts))


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
    lines = judged(ring, heard)
    assert [said in line for line in lines] == [True] if said else lines == []


def test_an_arm_that_is_put_on_turned_is_named() -> None:
    (line,) = judged(TURNING, heard_at(TURNING, lambda a: a + math.pi))
    assert "TURNED: sensor 0 looks 180 degrees away" in line
    (line,) = judged(TO_AND_FRO, heard_at(TO_AND_FRO, lambda a: a - math.radians(60.0)))
    assert "does not get there" in line


def heard_among_fixed(wired: dict[int, int], deaf: int | None = None) -> list[list[int]]:
    """Return which bearings hear each hand, given which sensor is wired as which, and which hears nothing."""
    ring, heard = AMONG_FIXED, list[list[int]]()
    of, axes = ring.sensor_of, [mount.angle_rad for mount in ring.mounts]
    for hand in hands_before(ring):
        heard.append([])
        for k, sensor in enumerate(of):
            # One on a servo that is fired as a fixed sensor stands anywhere: it looks ahead here.
            true = wired.get(sensor, sensor)
            looks = axes[k] if true == sensor else 0.0 if true == 0 else axes[of.index(true)]
            if true != deaf and abs(math.remainder(looks - hand.angle_rad, math.tau)) < BEAM_RAD:
                heard[-1].append(k)
    return heard


def test_beside_fixed_sensors_only_what_is_exchanged_is_called_so() -> None:
    assert judged(AMONG_FIXED, heard_among_fixed({})) == []
    left = judged(AMONG_FIXED, heard_among_fixed({0: 1, 1: 0}))
    assert left[0].startswith("EXCHANGED: a hand ahead (0 degrees) is heard by sensor 1, and sensor 0 belongs there")
    sides = judged(AMONG_FIXED, [[6], [12], [12, 14], [0, 13]])
    assert [line.partition(" is heard by sensor ")[2][:1] for line in sides] == ["2", "1"]
    (deaf,) = judged(AMONG_FIXED, heard_among_fixed({}, deaf=1))
    assert deaf.startswith("sensor 1 DOES NOT HEAR a hand to the left")
    (late,) = judged(AMONG_FIXED, [[6], [1 + 12], [13], [14]])
    assert "its servo does not get there" in late
    heard = heard_among_fixed({})
    heard[1] = [14]
    (side,) = judged(AMONG_FIXED, heard)
    assert side.startswith("EXCHANGED: a hand to the left (90 degrees) is heard by sensor 2")


@pytest.mark.parametrize(
    ("sweep_deg", "said"),
    [(30.0, "whether its servo turns or to which side"), (70.0, "whether its servo turns:"), (180.0, None)],
)
def test_what_hands_in_a_narrow_sweep_do_not_show_is_said(sweep_deg: float, said: str | None) -> None:
    (sensor,) = TO_AND_FRO.sensors or ()
    ring = TO_AND_FRO.model_copy(
        update={"sensors": (sensor.model_copy(update={"sweep_deg": sweep_deg, "bearings": 5}),)}
    )
    still, mirrored = (judged(ring, heard_at(ring, looks)) for looks in (lambda _: 0.0, lambda a: -a))
    lines = not_shown_by_hands(ring)
    assert [said in line for line in lines] == [True] if said else lines == []
    assert (still == mirrored == []) == (sweep_deg == 30.0)
    assert not_shown_by_hands(load_robot("denning").ring) == []


def test_one_range_all_round_is_named_and_a_wall_is_not() -> None:
    count = len(TURNING.mounts)
    assert stuck_servos(TURNING, [1.0, 1.003] * (count // 2))[0].startswith("ONE RANGE, 1.000 m")
    assert stuck_servos(TURNING, [1.0] * 7 + [math.inf] * (count - 7)) == {}
    assert stuck_servos(TURNING, [math.inf] * count) == {}
    assert stuck_servos(TURNING, np.linspace(0.5, 1.2, count).tolist()) == {}


@pytest.mark.parametrize("ring", [TO_AND_FRO, AMONG_FIXED], ids=["alone", "among fixed"])
@pytest.mark.parametrize("is_deaf", [False, True])
def test_the_hands_are_asked_for_and_heard(ring: RingConfig, is_deaf: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fixed sensor, which fires each time, hears a hand sooner than the bearing that looks there."""
    said, firings, asked_at = list[str](), [0], list[int]()
    count, hands = ring.sensor_of.count(0), hands_before(ring)

    def write(text: str) -> None:
        said.append(text)
        if text.startswith("hold "):
            asked_at.append(firings[0])

    async def exchange(_trial: RingTest) -> list[Floats]:
        firings[0] += 1
        turned = firings[0] % (2 * count)
        ranges, is_held = np.full(len(ring.mounts), math.nan), 2 * count < firings[0] - asked_at[-1] < 8 * count
        for k in (min(turned, 2 * count - 1 - turned), *range(count, len(ring.mounts))):
            off = abs(ring.mounts[k].angle_rad - hands[len(asked_at) - 1].angle_rad)
            ranges[k] = HAND_M if off < BEAM_RAD and is_held and not is_deaf else FREE_M
        return [ranges]

    monkeypatch.setattr(RingTest, "_exchange", exchange)
    config = load_settings("room", ("link.port=memory",), robot="servo1").model_copy(update={"ring": ring})
    trial = RingTest(with_single_firing(config), write, lambda: 0.01 * firings[0], ring)
    assert asyncio.run(trial._test_places([[FREE_M]] * len(ring.mounts))) is not is_deaf
    assert [line.split(", ")[1] for line in said[:2]] == ["ahead (0 degrees) …\n", "to the left (90 degrees) …\n"]
    assert ("DOES NOT HEAR" if is_deaf else "each sensor answers in its place") in said[len(hands)]
