"""P3: no response of a schema leads to an invalid command, from the arbiter to the bytes of a DRIVE frame."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from behaviors.arbiter import Drive, Stop, arbitrate
from behaviors.response import Response
from config.behaviors import ArbiterConfig
from config.robot import BodyConfig
from drivers.denning import frames
from drivers.denning.codec import Decoder
from drivers.messages import Twist
from perception.percept import Percept, Pose
from tests.behaviors.views import EVERYWHERE
from tests.drivers.driver_harness import CONFIG, DriverHarness

pytestmark = pytest.mark.promise("P3")

DECISIONS = 40_000
SOAK_DECISIONS = 1_000_000
BLOCK = 1000
"""Decisions with the same body and arbiter settings."""
SPECIAL = (0.0, -0.0, 1.0, 1e6, math.nan, math.inf, -math.inf, 1e308, -1e308, 1.7e308, 5e-324)
NAMES = ("move_ahead", "avoid_static_obstacle")


def numbers(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return numbers of every magnitude, 40 % of them special."""
    sizes = 10.0 ** rng.uniform(-320.0, 308.0, shape) * rng.choice([-1.0, 1.0], shape)
    return np.where(rng.random(shape) < 0.4, rng.choice(SPECIAL, shape), sizes)


def some_body(rng: np.random.Generator) -> BodyConfig:
    """Return a base whose limits are not whole millimetres per second."""
    speed, turn, radius = rng.uniform((0.001, 0.001, 0.01), (10.0, 20.0, 1.0)).tolist()
    return BodyConfig(radius_m=radius, speed_max_m_s=speed, turn_max_rad_s=turn)


def some_arbiter(rng: np.random.Generator) -> ArbiterConfig:
    base, cautious, gain, clearance = rng.uniform((0.001, 0.0, 0.01, 0.0), (10.0, 10.0, 100.0, 1.0)).tolist()
    return ArbiterConfig(
        base_velocity_m_s=base, cautious_velocity_m_s=cautious, turn_gain_per_s=gain, clearance_m=clearance
    )


def ready(body: BodyConfig) -> DriverHarness:
    """Return a driver after its handshake with the robot."""
    harness = DriverHarness(CONFIG.model_copy(update={"body": body}))
    harness.open()
    harness.handshake()
    return harness


def drives_in(data: bytes) -> list[frames.Drive]:
    decoder = Decoder("host")
    found = [frame for frame in decoder.feed(data) if isinstance(frame, frames.Drive)]
    assert (decoder.bad, decoder.lost) == (0, 0)
    assert decoder.frames == len(found)
    return found


def is_sound(rows: Sequence[Sequence[float]], pose: Pose, percept: Percept) -> bool:
    """Return whether these inputs allow a velocity."""
    parts = [*rows[0], *rows[1], *map(sum, zip(*rows, strict=True)), pose.x, pose.y, pose.theta]
    return all(map(math.isfinite, parts)) and bool(np.isfinite(percept.obstacles).all())


@pytest.mark.compiled
def test_random_schema_outputs(measured: Callable[[str], None]) -> None:
    check_decisions(DECISIONS, 3, measured)


@pytest.mark.soak
def test_a_million_random_schema_outputs(measured: Callable[[str], None]) -> None:
    check_decisions(SOAK_DECISIONS, 5, measured)


def check_decisions(count: int, seed: int, measured: Callable[[str], None]) -> None:
    """Send `count` random decisions through arbiter and driver, and decode what the driver sends."""
    rng = np.random.default_rng(seed)
    drives = stops = 0
    for _ in range(count // BLOCK):
        body, config = some_body(rng), some_arbiter(rng)
        harness, out = ready(body), bytearray()
        wild = rng.random((BLOCK, 1, 1)) < 0.5
        vectors = np.where(wild, numbers(rng, (BLOCK, 2, 2)), rng.normal(0.0, 1.0, (BLOCK, 2, 2)))
        percepts = []
        for points, of in zip(
            rng.uniform(-3.0, 3.0, (64, 4, 2)), rng.normal(0.0, 3.0, (64, 3)).tolist(), strict=True
        ):
            percepts.append(Percept(Pose(*of), points[: rng.integers(0, 5)], EVERYWHERE))
        percepts[0] = Percept(Pose(*numbers(rng, (3,)).tolist()), np.empty((0, 2)), EVERYWHERE)
        percepts[1] = Percept(Pose(0.0, 0.0, 0.0), numbers(rng, (3, 2)), EVERYWHERE)
        asked = 0
        for i, (first, second) in enumerate(vectors.tolist()):
            percept = percepts[i % 64]
            given = (Response(NAMES[0], *first), Response(NAMES[1], *second))
            decision = arbitrate(given, percept, body, config, NAMES)
            if isinstance(decision, Stop):
                stops += 1
                assert not is_sound((first, second), percept.pose, percept), (given, percept, decision)
                assert decision.reason
                continue
            asked += 1
            assert isinstance(decision, Drive)
            assert 0.0 <= decision.twist.v <= body.speed_max_m_s
            assert abs(decision.twist.w) <= body.turn_max_rad_s
            harness.robot.drive(decision.twist)
            out += harness.robot.outgoing(writable=True)
        sent = drives_in(bytes(out))
        assert len(sent) == asked, "each decision is one DRIVE"
        assert all(0 <= drive.v_mm_s <= 1e3 * body.speed_max_m_s + 1e-6 for drive in sent)
        assert all(abs(drive.w_mrad_s) <= 1e3 * body.turn_max_rad_s + 1e-6 for drive in sent)
        drives += asked
    assert drives + stops == count
    assert min(drives, stops) > 0.1 * count, "both were tried"
    measured(f"{count:,} decisions: {drives:,} DRIVEs on the wire, {stops:,} stops, 0 bad commands")


def test_driver_given_any_velocity_sends_nothing_bad(measured: Callable[[str], None]) -> None:
    """The driver does not rely on the arbiter: it refuses non-finite velocities and clamps the others."""
    rng = np.random.default_rng(4)
    refused = total = 0
    for _ in range(10):
        body = some_body(rng)
        harness, out, asked = ready(body), bytearray(), 0
        for v, w in numbers(rng, (2000, 2)).tolist():
            total += 1
            try:
                harness.robot.drive(Twist(v, w))
            except ValueError:
                refused += 1
                assert not (math.isfinite(v) and math.isfinite(w))
            else:
                asked += 1
            out += harness.robot.outgoing(writable=True)
        sent = drives_in(bytes(out))
        assert len(sent) == asked
        assert all(abs(drive.v_mm_s) <= 1e3 * body.speed_max_m_s + 1e-6 for drive in sent)
        assert all(abs(drive.w_mrad_s) <= 1e3 * body.turn_max_rad_s + 1e-6 for drive in sent)
    measured(f"{total:,} velocities given to the driver: {refused:,} refused, 0 bad commands")


@pytest.mark.parametrize("axis", [None, "1.0", 10**400, 1j, math.nan], ids=repr)
def test_a_missing_axis_is_a_stop_with_a_reason(axis: object) -> None:
    """A user's schema may omit an axis; that does not count as zero."""
    body, config = BodyConfig(radius_m=0.4, speed_max_m_s=0.5, turn_max_rad_s=1.0), ArbiterConfig()
    percept = Percept(Pose(0.0, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE)
    for x, y in ((axis, 0.0), (0.0, axis), (axis, axis)):
        given = (Response(NAMES[0], 1.0, 0.0), Response(NAMES[1], x, y))  # type: ignore[arg-type]
        decision = arbitrate(given, percept, body, config, NAMES)
        assert isinstance(decision, Stop)
        assert f"the schema {NAMES[1]} answered" in decision.reason
        assert "look for an axis left out" in decision.reason
        assert len(decision.reason) < 300


@pytest.mark.parametrize("given", [(), NAMES[:1], NAMES[1:], (*NAMES, "stranger"), (*NAMES, NAMES[0])], ids=str)
def test_a_decision_that_lacks_a_part_or_has_one_too_many_is_a_stop(given: tuple[str, ...]) -> None:
    body, config = BodyConfig(radius_m=0.4, speed_max_m_s=0.5, turn_max_rad_s=1.0), ArbiterConfig()
    percept = Percept(Pose(0.0, 0.0, 0.0), np.empty((0, 2)), EVERYWHERE)
    decision = arbitrate([Response(name, 1.0, 0.0) for name in given], percept, body, config, NAMES)
    assert isinstance(decision, Stop)
    assert decision.reason
