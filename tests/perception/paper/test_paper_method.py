"""The paper's statements about the whole method: recognition, continuous joining, ageing and warm starts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_settings, load_world
from config.settings import ClustersConfig, MapConfig, RelaxationConfig, Settings
from config.world import WallConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.detected_object import DetectedObject
from perception.paper.paper_method import PaperPerception
from perception.pipeline import Perception
from tests.perception.halls import FT, drive, drums, settings

TABLE_2_MEAN_FT = 0.25
TABLE_2_MAX_FT = 0.35


def perceive(chosen: Settings) -> PaperPerception:
    return PaperPerception(chosen.ring, chosen.models, chosen.perception)


def settle(perception: PaperPerception | Perception) -> int:
    """Refine until nothing is left to improve; return the iterations it took."""
    iterations = 0
    while perception.can_refine:
        iterations += perception.refine()
    return iterations


def errors_ft(objects: tuple[DetectedObject, ...], places_ft: list[tuple[float, float]]) -> list[float]:
    return [min((math.dist((o.x / FT, o.y / FT), p) for o in objects), default=math.inf) for p in places_ft]


HALL = [(x, y) for x in (1.0, 4.0, 7.0) for y in (4.0, -4.0)]


@pytest.mark.boundslong
def test_exactly_six_drums_are_found_within_the_errors_of_table_2() -> None:
    perception = perceive(settings())
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    objects = perception.objects()
    errors = errors_ft(objects, HALL)
    assert len(objects) == 6
    assert np.mean(errors) <= TABLE_2_MEAN_FT
    assert max(errors) <= TABLE_2_MAX_FT
    assert all(o.model == "drum" and 0.0 < o.score <= 1.0 and 0.0 < o.sigma < 0.1 for o in objects)


@pytest.mark.compiled
def test_objects_are_found_while_driving() -> None:
    """Segments join continuously: each pair of drums is found within a foot after the robot has passed it."""
    perception = perceive(settings())
    found_at: dict[int, float] = {}
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
        for i, error in enumerate(errors_ft(perception.objects(), HALL)):
            if error < 0.5:
                found_at.setdefault(i, firing.pose.x / FT)
    assert len(found_at) == 6
    assert all(found_at[i] < x + 1.0 for i, (x, _) in enumerate(HALL))


@pytest.mark.compiled
def test_warm_starts_take_a_few_iterations() -> None:
    """Paper §3.4: "only a few iterations are required" once a model is at rest and the map changes gradually."""
    perception = perceive(settings())
    warm = []
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        awake = perception.candidates.pending
        rested = int(perception.candidates.rows["has_rested"][: perception.clusters.count].sum())
        iterations = settle(perception)
        if rested >= 4 and awake:
            warm.append(iterations / awake)
    perception.candidates.clear()
    perception.candidates.follow(perception.clusters, perception.outline)
    cold = settle(perception) / 6
    assert len(warm) > 50
    assert np.median(warm) <= 8.0
    assert np.median(warm) < 0.7 * cold


@pytest.mark.covered
def test_the_size_of_quanta_does_not_change_results() -> None:
    """Refining two iterations at a time ends at the same pose as one long relaxation."""
    firings = list(drive(load_world("hallway"), (-6.0, 3.0)))
    poses = []
    for per_quantum in (2, 1000):
        perception = perceive(settings(relaxation=RelaxationConfig(iterations_per_quantum=per_quantum)))
        for firing in firings:
            perception.observe(firing)
            settle(perception)
        poses.append(perception.candidates.rows["pose"][: perception.clusters.count].copy())
    np.testing.assert_array_equal(poses[0], poses[1])


@pytest.mark.covered
def test_refinement_takes_turns() -> None:
    """No candidate waits until another is at rest."""
    perception = perceive(settings(relaxation=RelaxationConfig(iterations_per_quantum=1)))
    for firing in drive(load_world("hallway"), (-6.0, 8.0)):
        perception.observe(firing)
    before = perception.candidates.rows["pose"][: perception.clusters.count].copy()
    for _ in range(perception.clusters.count):
        perception.refine()
    moved = np.any(perception.candidates.rows["pose"][: perception.clusters.count] != before, axis=(1, 2))
    large = perception.clusters.sizes[: perception.clusters.count] >= settings().perception.clusters.segments_min
    np.testing.assert_array_equal(moved, large)


@pytest.mark.compiled
def test_old_segments_leave_and_their_objects_with_them() -> None:
    perception = perceive(settings(map=MapConfig(age_max_s=30.0)))
    last = None
    for last in drive(load_world("hallway")):
        perception.observe(last)
        settle(perception)
    assert last is not None
    assert perception.objects()
    silent = np.full(24, np.nan)
    perception.observe(Firing(last.robot_s + 29.0, last.pose, 0.0, silent))
    left = perception.outline.size
    assert 0 < left < perception.outline.total
    perception.observe(Firing(last.robot_s + 31.0, last.pose, 0.0, silent))
    assert perception.outline.size == 0
    assert perception.objects() == ()


@pytest.mark.compiled
def test_the_segments_of_a_removed_drum_are_contradicted() -> None:
    """Echoes from a wall behind its former place remove its segments from the map."""
    world = drums((4.0, 3.5))
    behind = WallConfig(x1_m=-20.0, y1_m=7.0 * FT, x2_m=20.0, y2_m=7.0 * FT)
    wall = load_world("hallway").model_copy(update={"drum": (), "wall": (behind,)})
    perception = perceive(settings())
    for firing in drive(world):
        perception.observe(firing)
        settle(perception)
    assert errors_ft(perception.objects(), [(4.0, 3.5)])[0] < 0.5
    for firing in drive(wall, begin_s=100.0):
        perception.observe(firing)
        settle(perception)
    assert all(o.y / FT > 6.0 for o in perception.objects())
    left = perception.outline.segments[perception.outline.status > 0]
    near = np.hypot(left[:, 0] - 4.0 * FT, left[:, 1] - 3.5 * FT) < 1.5 * FT
    assert near.sum() <= 2  # a segment seen from the side only is faced by no sensor that hears the wall


@pytest.mark.compiled
@pytest.mark.boundslong
def test_a_full_map_drops_its_oldest_segments() -> None:
    perception = perceive(settings(map=MapConfig(capacity=64)))
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
        assert perception.outline.count <= 64
    outline = perception.outline
    assert outline.total > 128
    order = [(outline.start + k) % 64 for k in range(outline.count)]
    assert list(outline.times[order]) == sorted(outline.times[order])


@pytest.mark.compiled
def test_a_split_cluster_is_one_object() -> None:
    """A small T splits each drum's segments into two clusters; both candidates come to rest on the same drum."""
    perception = perceive(settings(clusters=ClustersConfig(threshold_m=0.33)))
    for firing in drive(load_world("hallway")):
        perception.observe(firing)
        settle(perception)
    assert perception.clusters.count > 6
    assert len(perception.objects()) == 6


@pytest.mark.compiled
def test_a_turning_body_gives_the_same_objects() -> None:
    """With a ring that turns with its body, sensors sweep over the drums; positions agree."""
    world = drums((4.0, 4.0), (4.0, -4.0))
    straight, turning = perceive(settings()), perceive(settings())
    sonar = Sonar(load_settings("hallway").ring, compile_scene(world), world.acoustics, np.random.default_rng(0))
    for firing in drive(world):
        straight.observe(firing)
        settle(straight)
        yaw = 0.4 * math.sin(firing.robot_s)
        pose = Pose(firing.pose.x, firing.pose.y, yaw)
        fired = np.flatnonzero(~np.isnan(firing.ranges_m))
        turning.observe(Firing(firing.robot_s, pose, yaw, sonar.fire(pose, yaw, [int(i) for i in fired])))
        settle(turning)
    for perception in (straight, turning):
        assert max(errors_ft(perception.objects(), [(4.0, 4.0), (4.0, -4.0)])) <= TABLE_2_MAX_FT


@pytest.mark.parametrize("seed", [11, 12, 13])
@pytest.mark.compiled
def test_noise_of_one_percent_leaves_at_least_seven_of_eight(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, places = 1.0, []
    for i in range(8):
        places.append((x, (1.0 if i % 2 else -1.0) * float(rng.uniform(3.4, 4.6))))
        x += rng.uniform(1.2, 1.9)
    world = drums(*places)
    world = world.model_copy(update={"acoustics": world.acoustics.model_copy(update={"noise_relative": 0.01})})
    perception = perceive(settings())
    for firing in drive(world, (-6.0, x + 5.0)):
        perception.observe(firing)
        settle(perception)
    assert sum(error <= 0.5 for error in errors_ft(perception.objects(), places)) >= 7
