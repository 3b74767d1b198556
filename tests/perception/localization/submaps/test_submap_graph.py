"""A drive round a room: drift is corrected, exact odometry is left alone, and a snapshot goes on to the bit."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.world import AcousticsConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from perception.kernel import Floats
from perception.localization.submaps.submap_graph import SubmapGraph, walk
from perception.snapshot import put_back, snapshot_of
from tests.perception.localization.rooms import RING, world_of

pytestmark = pytest.mark.compiled

ROOM = (
    (0.0, 0.0), (7.0, 0.0), (7.0, 2.6), (4.4, 2.6), (4.4, 5.2),
    (0.0, 5.2), (0.0, 3.1), (1.2, 3.1), (1.2, 2.2), (0.0, 2.2),
)  # fmt: skip
"""Corners of an angled room with a niche, m."""
LOOP = ((1.0, 1.1), (6.0, 1.3), (3.6, 1.5), (3.2, 4.3), (2.0, 4.1))


def driven(way_scale: float, turn_scale: float, rounds: int = 3, seed: int = 1) -> tuple[list[Firing], Floats]:
    """Return firings every 0.1 m of a drive round the room, odometry long by these shares, and the true poses."""
    truth: list[tuple[float, float, float]] = []
    corners = [np.array(LOOP[k % len(LOOP)]) for k in range(rounds * len(LOOP) + 1)]
    for a, b in itertools.pairwise(corners):
        heading = math.atan2(*(b - a)[::-1])
        if truth:
            turn = (heading - truth[-1][2] + math.pi) % (2.0 * math.pi) - math.pi
            truth += [(*a, truth[-1][2] + turn * share) for share in np.arange(0.1, 1.0, 0.1).tolist()]
        heading = truth[-1][2] + (heading - truth[-1][2] + math.pi) % (2.0 * math.pi) - math.pi if truth else heading
        steps = max(2, int(np.hypot(*(b - a)) / 0.1))
        truth += [(*(a + (b - a) * k / steps), heading) for k in range(steps)]
    true = np.array(truth)
    acoustics = AcousticsConfig(model="cone")
    sonar = Sonar(RING, compile_scene(world_of(ROOM, acoustics)), acoustics, np.random.default_rng(seed))
    here, firings = Pose(*true[0].tolist()), []
    for k, pose in enumerate(true.tolist()):
        if k:
            before = Pose(*true[k - 1].tolist())
            moved = before.inverse().compose(Pose(*pose))
            step = Pose(moved.x * (1.0 + way_scale), moved.y * (1.0 + way_scale), moved.theta * (1.0 + turn_scale))
            here = here.compose(step)
        firings.append(Firing(0.3 * k, here, here.theta, sonar.fire(Pose(*pose), pose[2], range(k % 2, 24, 2))))
    return firings, true


def follow(graph: SubmapGraph, firings: list[Firing]) -> tuple[Floats, Floats]:
    """Enter firings; return the ring's poses as known at each moment, and as known at the end."""
    now, moments = [], []
    for firing in firings:
        graph.observe(firing)
        while graph.can_refine:
            graph.refine()
        here = graph.localized()
        now.append((here.pose.x, here.pose.y, here.pose.theta))
        moments.append(graph.moment())
    return np.array(now), np.array([graph.placed(moment) for moment in moments])


def rms(poses: Floats, truth: Floats) -> float:
    """Return the error of the place, m; all begin at the same pose."""
    return float(np.sqrt(((poses[:, :2] - truth[:, :2]) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize(("way", "turn"), [(0.04, 0.02), pytest.param(-0.03, -0.03, marks=pytest.mark.soak)])
def test_drift_is_corrected(way: float, turn: float) -> None:
    firings, truth = driven(way, turn)
    odometry = np.array([(f.pose.x, f.pose.y, f.pose.theta) for f in firings])
    graph = SubmapGraph(RING)
    now, end = follow(graph, firings)
    assert graph.is_applied
    assert rms(end, truth) < 0.5 * rms(odometry, truth)
    assert rms(now[len(now) // 2 :], truth[len(now) // 2 :]) < rms(odometry[len(now) // 2 :], truth[len(now) // 2 :])
    here = graph.localized()
    assert here.status == "tracking"
    assert here.pose.theta == pytest.approx(here.ring_yaw)
    error = now[-1, :2] - truth[-1, :2]
    assert error @ np.linalg.inv(here.covariance[:2, :2]) @ error < 16.0
    known = graph.known_way()
    assert graph.known_way() is known, "nothing has changed"
    assert len(known.maps) == graph.count
    assert known.maps[0, 2:].tolist() == [0.0, 0.0, 0.0]
    assert np.linalg.eigvalsh(known.maps[1:, [2, 3, 3, 4]].reshape(-1, 2, 2)).min() > 0.0
    assert len(known.loops) > 0
    for place in known.loops.reshape(-1, 2):
        assert np.abs(known.maps[:, :2] - place).sum(axis=1).min() == 0.0
    apart = np.hypot(*(end[:, None, :2] - known.path[None]).transpose(2, 0, 1))
    assert apart.min(axis=1).max() < 0.35, "the path passes all places of the drive"
    assert apart.min(axis=0).max() < 0.05, "and no others"


def test_exact_odometry_is_left_alone() -> None:
    firings, truth = driven(0.0, 0.0)
    graph = SubmapGraph(RING)
    now, end = follow(graph, firings)
    assert not graph.is_applied
    np.testing.assert_allclose(now, truth, atol=1e-9)
    np.testing.assert_allclose(end, truth, atol=1e-9)
    assert graph.odometry_from_map() == Pose(0.0, 0.0, 0.0)


def test_a_snapshot_in_the_middle_of_a_job_goes_on_to_the_bit() -> None:
    firings, _ = driven(0.04, 0.02, rounds=1)
    graph = SubmapGraph(RING)
    for k, firing in enumerate(firings):
        graph.observe(firing)
        for _ in range(7):  # fewer than are needed: jobs last longer than a map
            if graph.can_refine:
                graph.refine()
        if k == len(firings) - 20:
            break
    other = SubmapGraph(RING)
    other.observe(firings[0])
    put_back(other, snapshot_of(graph))
    other.drop_caches()
    for firing in firings[-19:]:
        for one in (graph, other):
            one.observe(firing)
            for _ in range(11):
                if one.can_refine:
                    one.refine()
    while graph.can_refine:
        graph.refine()
        other.refine()
    assert not other.can_refine
    mine, its = snapshot_of(graph), snapshot_of(other)
    assert all(np.array_equal(mine[name], its[name], equal_nan=mine[name].dtype.kind == "f") for name in mine)


def test_grids_that_are_not_kept_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    firings, _ = driven(0.04, 0.02, 1)
    whole = follow(SubmapGraph(RING), firings)
    monkeypatch.setattr("perception.localization.submaps.submap_graph.GRIDS_MAX", 2)
    few = SubmapGraph(RING)
    assert np.array_equal(follow(few, firings), whole)
    assert few.count > 4
    assert len(few._grids) == 2


def test_after_a_reset_nothing_is_left() -> None:
    firings, _ = driven(0.04, 0.02, rounds=1)
    graph = SubmapGraph(RING)
    follow(graph, firings[:80])
    graph.reset()
    follow(graph, firings[:80])
    other = SubmapGraph(RING)
    follow(other, firings[:80])
    mine, its = snapshot_of(graph), snapshot_of(other)
    assert all(np.array_equal(mine[name], its[name]) for name in mine)


def test_a_robot_that_turns_on_the_spot_makes_a_map_of_two_radians() -> None:
    graph = SubmapGraph(RING)
    for k in range(100):
        graph.observe(Firing(0.1 * k, Pose(0.0, 0.0, 0.05 * k), 0.05 * k, np.full(24, 2.0)))
    assert graph.moment().submap == 2
    assert graph.can_refine


def test_the_walk_grows_with_the_way() -> None:
    short, long = (walk(np.array([way, 0.0, 0.0]), way, 0.0) for way in (1.0, 3.0))
    assert np.all(np.linalg.eigvalsh(long - short) > 0.0)


def test_what_is_remembered_moves_when_poses_are_corrected() -> None:
    firings, truth = driven(0.04, 0.02)
    graph, moved = SubmapGraph(RING), 0
    for firing in firings:
        moves = graph.moves()
        assert graph.moves() is None, "once"
        moved += moves is not None
        assert graph.is_applied or moves is None
        graph.observe(firing)
        here = Pose(*graph.in_filter().tolist())
        seen = graph.odometry_from_filter().compose(here)
        assert (seen.x, seen.y) == pytest.approx((firing.pose.x, firing.pose.y))
        while graph.can_refine:
            graph.refine()
    assert 1 <= moved <= graph.count
    # The maps stand to each other as they truly do, and not as odometry had them.
    odometry = graph._submaps.archived_rows["pose"]
    entered = np.array([(one.pose.x, one.pose.y, one.pose.theta) for one in firings])
    true = np.array([truth[np.abs(entered - pose).sum(axis=1).argmin()] for pose in odometry])
    errors = []
    for poses in (graph.held.archived_rows, odometry):
        apart = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).transpose(2, 0, 1))
        truly = np.hypot(*(true[:, None, :2] - true[None, :, :2]).transpose(2, 0, 1))
        errors.append(float(np.abs(apart - truly).mean()))
    assert errors[0] < 0.5 * errors[1], errors
