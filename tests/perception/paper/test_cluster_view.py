"""Clusters for display: a box around each, with enough segments, at the paper's threshold."""

from __future__ import annotations

import numpy as np
import pytest

from config.load import load_settings
from perception.paper.cluster_view import ClusterView

pytestmark = pytest.mark.compiled


def segments(x: float, count: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return short segments along y at x."""
    return np.array([[x, 0.05 * k, x, 0.05 * (k + 1), np.pi] for k in range(count)])


def test_two_groups_are_two_boxes() -> None:
    config = load_settings("hallway").perception
    least = config.clusters.segments_min
    view = ClusterView(config)
    first, second = view.boxes(np.vstack([segments(1.0, least), segments(3.0, least + 1)]))
    assert (first.x, first.length, first.angle) == (1.0, 0.0, 0.0)
    assert first.width == pytest.approx(0.05 * least)
    assert (first.segments, second.segments) == (least, least + 1)
    assert second.centre_x == 3.0
    assert second.centre_y == pytest.approx(0.025 * (least + 1), abs=1e-3)


def test_too_few_segments_are_no_cluster() -> None:
    config = load_settings("hallway").perception
    view = ClusterView(config)
    assert view.boxes(np.zeros((0, 5))) == []
    assert view.boxes(segments(1.0, config.clusters.segments_min - 1)) == []
