"""Tests of the scenes: places, counts, chance, and noiseless ranges by the closed form."""

from __future__ import annotations

import math
from typing import get_args

import numpy as np
import pytest

from config.load import load_robot
from config.world import WorldConfig
from drivers.messages import Firing, Floats
from runtime.simulation.scene_names import SceneName
from runtime.simulation.scenes import Hall, halls, readings

FT = 0.3048
RING = load_robot("denning").ring
DRUMS_FT = {(1, 4), (4, 4), (7, 4), (1, -4), (4, -4), (7, -4)}
NAMES = tuple(name for name in get_args(SceneName) if name != "halls")


def places_ft(hall: Hall) -> list[tuple[float, float]]:
    drums = [(drum.x_m / FT, drum.y_m / FT) for drum in hall.world.drum]
    return drums + [(box.x_m / FT, box.y_m / FT) for box in hall.world.box]


def heard(hall: Hall, seed: int = 0) -> Floats:
    return np.array([firing.ranges_m for firing in readings(RING, hall, seed)])


def test_the_ring_is_the_one_of_the_scenes() -> None:
    assert len(RING.mounts) == 24
    assert [math.hypot(m.x_m, m.y_m) / FT for m in RING.mounts] == pytest.approx([1.25] * 24)
    assert RING.beam_half_angle_deg == 12.0
    assert [v / FT for v in (RING.resolution_m, RING.range_min_m, RING.range_max_m)] == pytest.approx(
        [0.1, 0.5, 25.5]
    )


@pytest.mark.parametrize("name", NAMES)
def test_every_scene_has_its_halls(name: SceneName) -> None:
    got = halls(name)
    assert len(got) == {"moved": 10, "jit10": 10, "boxes": 4, "boxes_facing": 2, "boxes_45": 2}.get(name, 1)
    assert len({hall.name for hall in got}) == len(got)
    for hall in got:
        assert len(places_ft(hall)) == 6
        if name.startswith("boxes"):
            assert not hall.world.drum
            assert all((b.width_m / FT, b.depth_m / FT) == pytest.approx((2.0, 2.0)) for b in hall.world.box)
        else:
            assert not hall.world.box
            assert hall.world.acoustics.model == "specular"
            assert [d.radius_m / FT for d in hall.world.drum] == pytest.approx([1.0] * 6)
        if name not in {"moved", "jit10"}:
            assert {(round(x, 9), round(y, 9)) for x, y in places_ft(hall)} == DRUMS_FT


def test_boxes_face_the_path_or_turn_a_corner_to_it_under_both_acoustics() -> None:
    got = [(hall.world.box[0].angle_deg, hall.world.acoustics.model) for hall in halls("boxes")]
    assert got == [(0.0, "cone"), (0.0, "specular"), (45.0, "cone"), (45.0, "specular")]
    assert halls("boxes") == halls("boxes_facing") + halls("boxes_45")


def test_noise_is_as_specified() -> None:
    def sound(name: SceneName) -> list[float]:
        a = halls(name)[0].world.acoustics
        return [a.noise_m / FT, a.dropout, a.outliers, a.noise_relative, (a.outlier_max_m or 0.0) / FT]

    assert sound("noisy") == pytest.approx([0.05, 0.10, 0.03, 0.0, 15.0])
    assert sound("jit10") == pytest.approx([0.03, 0.05, 0.01, 0.0, 15.0])
    for name in ("clean", "moved", "walls"):
        assert sound(name)[:4] == [0.0] * 4


def test_drums_move_by_chance_of_the_seed_within_the_limit() -> None:
    home = np.array([(x, y) for y in (4.0, -4.0) for x in (1.0, 4.0, 7.0)])
    moves = np.array([places_ft(hall) for hall in halls("jit10")]) - home
    assert np.abs(moves).max() <= 0.4 + 1e-9
    assert np.abs(moves).max() > 0.35
    assert abs(moves.mean()) < 0.1
    assert len(np.unique(moves.round(6))) == moves.size
    assert [places_ft(h) for h in halls("moved")] == [places_ft(h) for h in halls("jit10")]
    assert halls("jit10", seed=3) == halls("jit10", seed=3)
    assert places_ft(halls("jit10", seed=3)[0]) != places_ft(halls("jit10")[0])


def test_a_pass_is_81_readings_of_the_whole_ring_a_quarter_foot_apart() -> None:
    firings = list(readings(RING, halls("noisy")[0], seed=0))
    assert len(firings) == 81
    assert [f.pose.x / FT for f in firings] == pytest.approx(np.arange(-6.0, 14.01, 0.25).tolist())
    assert all(f.pose.y == 0.0 and f.pose.theta == 0.0 and f.ring_yaw == 0.0 for f in firings)
    assert not any(np.isnan(f.ranges_m).any() for f in firings)
    assert [f.robot_s for f in firings] == sorted({f.robot_s for f in firings})


def test_passes_go_down_the_hall_and_up_again() -> None:
    firings: list[Firing] = list(readings(RING, halls("clean")[0], seed=0, passes=3))
    x_ft = np.array([f.pose.x / FT for f in firings]).reshape(3, 81)
    np.testing.assert_allclose(x_ft[1], x_ft[0][::-1])
    np.testing.assert_allclose(x_ft[2], x_ft[0])
    assert [firings[k].pose.theta for k in (80, 81, 162)] == [0.0, math.pi, 0.0]
    np.testing.assert_array_equal(firings[0].ranges_m, firings[162].ranges_m)


def test_one_seed_one_noise() -> None:
    hall = halls("noisy")[0]
    np.testing.assert_array_equal(heard(hall, 1), heard(hall, 1))
    assert not np.array_equal(heard(hall, 1), heard(hall, 2))
    np.testing.assert_array_equal(heard(halls("clean")[0], 1), heard(halls("clean")[0], 2))


def closed_form_ft(hall: Hall, x: float, y: float, angle: float) -> float:
    """Nearest drum whose centre lies in the beam and that no other drum stands in front of; lengths in feet."""
    best = math.inf
    for k, (cx, cy) in enumerate(places_ft(hall)):
        away = math.hypot(cx - x, cy - y)
        ux, uy = (cx - x) / away, (cy - y) / away
        if ux * math.cos(angle) + uy * math.sin(angle) < math.cos(math.radians(12.0)):
            continue
        others = [p for j, p in enumerate(places_ft(hall)) if j != k]
        ahead = [(ox - x) * ux + (oy - y) * uy for ox, oy in others]
        lateral = [abs((ox - x) * uy - (oy - y) * ux) for ox, oy in others]
        if not any(0.0 < a < away - 1.0 and b < 1.0 for a, b in zip(ahead, lateral, strict=True)):
            best = min(best, away - 1.0)
    return best


@pytest.mark.parametrize("hall", [halls("clean")[0], *halls("moved")[:3]], ids=lambda hall: hall.name)
def test_ranges_without_noise_are_the_closed_form_to_a_tenth_of_a_foot(hall: Hall) -> None:
    echoes = 0
    for firing in readings(RING, hall, seed=0):
        for mount, got in zip(RING.mounts, firing.ranges_m / FT, strict=True):
            want = closed_form_ft(hall, (firing.pose.x + mount.x_m) / FT, mount.y_m / FT, mount.angle_rad)
            assert math.isinf(got) == (want > 25.5)
            if math.isfinite(got):
                echoes += 1
                assert got == pytest.approx(want, abs=0.05 + 1e-9)
                assert got / 0.1 == pytest.approx(round(got / 0.1), abs=1e-6)
    assert echoes > 400


def test_walls_answer_from_the_side_and_from_the_end() -> None:
    for firing in readings(RING, halls("walls")[0], seed=0):
        x = firing.pose.x / FT
        assert firing.ranges_m[0] / FT == pytest.approx(17.0 - x - 1.25, abs=0.05 + 1e-9)
        if x > 9.5 or x < -1.5:
            assert firing.ranges_m[[6, 18]] / FT == pytest.approx([6.75, 6.75], abs=0.05 + 1e-9)


def test_worlds_of_scenes_survive_a_world_file() -> None:
    for name in NAMES:
        for hall in halls(name):
            assert WorldConfig.model_validate(hall.world.model_dump()) == hall.world
