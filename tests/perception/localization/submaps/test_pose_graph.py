"""The graph's solution is that of dense linear algebra; a wrong match loses its weight."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from perception.kernel import Floats
from perception.localization.submaps.pose_graph import (
    GRAPH_SCALE_SIGMAS,
    SCALES,
    Link,
    Node,
    begin_step,
    go_on,
    linearise,
    multiply,
    spread_from,
)
from perception.localization.submaps.submap_records import (
    LOST_WAY,
    between,
    compose,
    node_at,
    odometry_link,
    scaled,
)
from perception.records import Structured, records
from tests.perception.localization.submaps.test_submap_records import matched

INFORMATION = np.diag([400.0, 300.0, 900.0])


def chain(count: int = 7, scales: Floats | None = None) -> tuple[list[Floats], Structured]:
    """Return poses round a corner, and odometry's links between them, which is wrong by its scales."""
    rng = np.random.default_rng(1)
    poses, links = [np.array([1.0, 2.0, 0.3])], []
    for k in range(1, count):
        moved = np.array([1.0 + 0.2 * rng.random(), 0.1 * rng.random(), 0.5 - rng.random()])
        poses.append(compose(poses[-1], moved if scales is None else scaled(moved, scales)))
        links.append(odometry_link(k - 1, moved, INFORMATION))
    return poses, np.concatenate(links)


def solve(links: Structured, nodes: NDArray[np.void], steps: int = 8) -> tuple[Floats, float]:
    """Solve the graph in place; return the scales and the last cost."""
    held, at, scales = records(Link, links), records(Node, nodes), np.zeros(SCALES)
    jacobians, residuals = np.empty((len(links), 3, 6 + SCALES)), np.empty((len(links), 3))
    vectors = np.empty((6, SCALES + 3 * len(nodes)))
    cost = 0.0
    for _ in range(steps):
        cost = linearise(held, len(links), at, scales, jacobians, residuals)
        begin_step(held, len(links), scales, jacobians, residuals, vectors)
        go_on(held, len(links), jacobians, vectors, 4 * vectors.shape[1])
        scales += vectors[0, :SCALES]
        for k, name in enumerate(("x", "y", "theta")):
            nodes[name] += vectors[0, SCALES + k :: 3]
    return scales, cost


def at_poses(poses: list[Floats]) -> Structured:
    """Return nodes at poses."""
    return np.concatenate([node_at(pose) for pose in poses])


def test_a_step_is_that_of_dense_algebra() -> None:
    poses, links = chain()
    links = np.concatenate([links, matched(0, 5, between(poses[0], poses[5]) + 0.1, 50.0 * np.eye(3), is_next=True)])
    rng = np.random.default_rng(2)
    nodes = at_poses([pose + 0.05 * rng.normal(size=3) for pose in poses])
    held, at, scales, size = (
        records(Link, links),
        records(Node, nodes),
        np.array([0.01, -0.02, 0.03, -0.01]),
        SCALES + 21,
    )
    jacobians, residuals = np.empty((len(links), 3, 6 + SCALES)), np.empty((len(links), 3))
    linearise(held, len(links), at, scales, jacobians, residuals)
    matrix = np.zeros((size, size))
    matrix[range(SCALES), range(SCALES)] = 1.0 / np.square(GRAPH_SCALE_SIGMAS)
    gradient = np.zeros(size)
    gradient[:SCALES] = -scales / np.square(GRAPH_SCALE_SIGMAS)
    for link, part, residual in zip(links, jacobians, residuals, strict=True):
        whole = np.zeros((3, size))
        whole[:, SCALES + 3 * link["of"] : SCALES + 3 * link["of"] + 3] = part[:, :3]
        whole[:, SCALES + 3 * link["to"] : SCALES + 3 * link["to"] + 3] = part[:, 3:6]
        whole[:, :SCALES] = part[:, 6:]
        matrix += link["weight"] * whole.T @ link["information"] @ whole
        gradient -= link["weight"] * whole.T @ link["information"] @ residual
    keep = [k for k in range(size) if not SCALES <= k < SCALES + 3]
    expected = np.linalg.solve(matrix[np.ix_(keep, keep)], gradient[keep])
    vectors = np.empty((6, size))
    begin_step(held, len(links), scales, jacobians, residuals, vectors)
    go_on(held, len(links), jacobians, vectors, 200)
    np.testing.assert_allclose(vectors[0, keep], expected, atol=1e-6)
    given, result = rng.normal(size=size), np.empty(size)
    given[SCALES : SCALES + 3] = 0.0
    multiply(held, len(links), jacobians, given, result)
    np.testing.assert_allclose(result[keep], (matrix @ given)[keep], rtol=1e-9)


def test_residuals_slope_as_the_derivatives_say() -> None:
    poses, links = chain(3)
    jacobians, residuals = np.empty((2, 3, 6 + SCALES)), np.empty((2, 3))
    linearise(records(Link, links), 2, records(Node, at_poses(poses)), np.zeros(SCALES), jacobians, residuals)
    for column in range(3):
        moved = [pose.copy() for pose in poses]
        moved[1][column] += 1e-6
        later = np.empty((2, 3))
        linearise(records(Link, links), 2, records(Node, at_poses(moved)), np.zeros(SCALES), jacobians.copy(), later)
        np.testing.assert_allclose((later[0] - residuals[0]) / 1e-6, jacobians[0, :, 3 + column], atol=1e-5)
        np.testing.assert_allclose((later[1] - residuals[1]) / 1e-6, jacobians[1, :, column], atol=1e-5)


@pytest.mark.covered
def test_matches_show_the_scales_of_odometry() -> None:
    true = np.array([-0.03, 0.04])
    poses, links = chain(12, true)
    matches = [
        matched(k, k + 4, between(poses[k], poses[k + 4]), 1e6 * np.eye(3), is_next=False) for k in range(0, 8, 2)
    ]
    raw, _ = chain(12)
    scales, _ = solve(np.concatenate([links, *matches]), at_poses(raw))
    # Matches that have lost way, and odometry that is short, look alike: both by half, by their priors.
    assert scales[0] - scales[3] == pytest.approx(true[0] + LOST_WAY[1], abs=0.012)
    assert scales[0] < 0.0 < scales[3]
    assert 0.0 < scales[1] < true[1]  # a few turns are little evidence beside the prior of 3 %


@pytest.mark.covered
def test_a_wrong_match_loses_its_weight() -> None:
    poses, links = chain()
    right = [matched(k, k + 3, between(poses[k], poses[k + 3]), INFORMATION, is_next=False) for k in range(3)]
    wrong = matched(0, 6, between(poses[0], poses[6]) + np.array([2.0, -1.0, 0.5]), INFORMATION, is_next=False)
    links, nodes = np.concatenate([links, *right, wrong]), at_poses(poses)
    solve(links, nodes, 20)
    assert links["weight"][-1] < 0.05
    np.testing.assert_allclose(nodes["x"], [pose[0] for pose in poses], atol=0.08)
    np.testing.assert_allclose(nodes["y"], [pose[1] for pose in poses], atol=0.08)


def test_what_lies_farther_along_the_chain_is_less_certain() -> None:
    poses, links = chain()
    spread = np.full((7, 2), np.inf)
    spread[0] = 0.0
    spread_from(records(Link, links), len(links), records(Node, at_poses(poses)), spread)
    assert np.all(np.diff(spread, axis=0) > 0.0)
    np.testing.assert_allclose(spread[:, 1], np.arange(7) / 900.0)
    assert spread[1, 0] == pytest.approx(1.0 / 400.0 + 1.0 / 300.0)
