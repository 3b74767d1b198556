"""Surfaces around a robot that stands: each found once, where it is, by kind, and no kind from what shows none."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from bench.one_stand import world_of
from config.load import load_settings
from config.robot import RingConfig
from config.world import WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import cross_pairs, firing_pattern, sensors
from drivers.messages import CrossPaths, Firing, Pose
from perception.stand import last_round, stand_of, surfaces_of_stand

RING = load_settings("hallway", robot="ears").ring
BEARING, RANGE_M = 0.4, 1.4


def heard(world: WorldConfig, ring: RingConfig = RING, rounds: int = 2) -> list[Firing]:
    """Return the firings of some rounds of the ring's pattern at the origin of a world."""
    sonar = Sonar(ring, compile_scene(world), world.acoustics, np.random.default_rng(1))
    pattern, at = firing_pattern(ring), Pose(0.0, 0.0, 0.0)
    axes = tuple(mount.angle_rad for mount in ring.mounts)
    firings = []
    for k, (fired, listening) in enumerate(list(zip(pattern.masks, pattern.listeners, strict=True)) * rounds):
        found = sonar.fire(at, 0.0, sensors(fired), None, sensors(listening))
        ranges = np.full(len(axes), np.nan)
        ranges[list(sensors(fired))] = found[list(sensors(fired))]
        transmitters, listeners = np.array(cross_pairs(axes, fired, listening)).T
        crosses = CrossPaths(transmitters, listeners, found[listeners])
        firings.append(Firing(0.03 * k, at, 0.0, ranges, crosses))
    return firings


def scene(name: str, noise_m: float = 1e-3) -> WorldConfig:
    return world_of(name, BEARING, RANGE_M, noise_m, np.random.default_rng(1))  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "kinds"), [
    ("wall", {"plane"}), ("drum", {"cylinder", "convex"}), ("post", {"cylinder", "edge", "convex"}),
])  # fmt: skip
def test_one_surface_is_found_once_where_it_is(name: str, kinds: set[str]) -> None:
    (found,) = surfaces_of_stand(RING, heard(scene(name)))
    assert found.kind in kinds
    assert found.paths > 10
    assert found.echo.range_m == pytest.approx(RANGE_M, abs=2e-3)
    assert found.echo.bearing == pytest.approx(BEARING, abs=math.radians(0.5))
    ring = Pose(1.0, 2.0, math.pi / 2)
    assert found.place(ring) == pytest.approx(
        (1.0 - RANGE_M * math.sin(BEARING), 2.0 + RANGE_M * math.cos(BEARING)), abs=0.02
    )


def test_a_corner_is_heard_between_its_walls() -> None:
    found = surfaces_of_stand(RING, heard(scene("corner")))
    assert [one.kind for one in found] == ["plane", "plane", "corner"]
    assert found[-1].echo.range_m == pytest.approx(RANGE_M, abs=3e-3)
    away = sorted(math.remainder(one.echo.bearing - BEARING, 2.0 * math.pi) for one in found)
    assert away == pytest.approx([-math.pi / 4, 0.0, math.pi / 4], abs=0.01)


def test_coarse_ranges_name_nothing_wrongly() -> None:
    ring = RING.model_copy(update={"resolution_m": 0.03048})
    assert {one.kind for one in surfaces_of_stand(ring, heard(scene("drum"), ring))} <= {"unknown", "convex"}


def test_strays_are_left_out_and_silence_is_no_surface() -> None:
    firings = heard(scene("wall"), rounds=5)
    stray = firings[1].ranges_m
    stray[np.isfinite(stray)] -= 0.5
    (found,) = surfaces_of_stand(RING, firings)
    assert found.kind == "plane"
    assert surfaces_of_stand(RING, ()) == ()
    silent = [Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.full(24, math.inf))]
    assert surfaces_of_stand(RING, silent) == ()
    alone = [Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.where(np.arange(24) == 3, 1.0, np.nan))]
    assert surfaces_of_stand(RING, alone) == (), "one path shows no bearing"


def test_a_stand_ends_where_the_robot_moves() -> None:
    def at(*places: tuple[float, float]) -> Sequence[Firing]:
        nothing = np.full(24, np.nan)
        return [Firing(float(k), Pose(x, 0.0, turn), turn, nothing) for k, (x, turn) in enumerate(places)]

    firings = at((0.0, 0.0), (0.001, 0.0), (0.1, 0.0), (0.2, 0.0), (0.2, 0.001), (0.2, 0.1))
    for robot_s, times in ((0.0, [0, 1]), (2.9, [2]), (3.0, [3, 4]), (math.inf, [5]), (-1.0, [])):
        assert [firing.robot_s for firing in stand_of(firings, robot_s)] == times


def test_the_last_round_of_a_stand_is_what_no_sensor_fires_twice_in() -> None:
    firings = heard(scene("wall"), rounds=2)
    half = len(firings) // 2
    assert last_round(firings) == firings[half:]
    assert last_round(firings[: half + 1]) == firings[1 : half + 1]
    assert last_round(firings[:2]) == firings[:2]
    assert last_round([]) == []
