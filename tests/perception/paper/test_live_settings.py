"""Settings that change while perception runs: afterwards it behaves as if they had been set from the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from config.load import load_world
from config.settings import PerceptionConfig
from drivers.messages import Firing
from perception.edits import PlaceModel
from perception.paper.paper_method import PaperPerception
from tests.perception.edited import settle
from tests.perception.halls import drive, settings

SHIPPED = settings()


@pytest.fixture(scope="module")
def firings() -> list[Firing]:
    return list(drive(load_world("hallway"), (-4.0, 6.0)))


def perceived(firings: list[Firing], config: PerceptionConfig = SHIPPED.perception) -> PaperPerception:
    perception = PaperPerception(SHIPPED.ring, SHIPPED.models, config)
    for firing in firings:
        perception.observe(firing)
        settle(perception)  # type: ignore[arg-type]
    return perception


def changed(**sections: dict[str, Any]) -> PerceptionConfig:
    """Return the shipped settings of the paper's method with some values replaced, by section."""
    config = SHIPPED.perception
    return config.model_copy(
        update={name: getattr(config, name).model_copy(update=values) for name, values in sections.items()}
    )


def test_another_gamma_relaxes_everything_again_to_another_pose(firings: list[Firing]) -> None:
    perception = perceived(firings)
    assert perception.edit(PlaceModel("drum", 0.3, 1.2, 0.0)) is None
    settle(perception)  # type: ignore[arg-type]
    rested, placed = perception.candidates.rows["pose"].copy(), perception.placements.rows["pose"].copy()
    perception.apply_settings(SHIPPED.perception)
    assert not perception.can_refine, "the same settings restart nothing"
    perception.apply_settings(changed(relaxation={"gamma": 3.0}))
    assert perception.candidates.pending == int((perception.candidates.rows["number"] > 0).sum()) > 0
    assert perception.placements.pending
    settle(perception)  # type: ignore[arg-type]
    many = perception.clusters.count
    assert np.abs(perception.candidates.rows["pose"][:many] - rested[:many]).max() > 1e-4
    assert np.abs(perception.placements.rows["pose"][0] - placed[0]).max() > 1e-5
    perception.apply_settings(SHIPPED.perception)
    settle(perception)  # type: ignore[arg-type]
    np.testing.assert_allclose(perception.candidates.rows["pose"][:many], rested[:many], atol=0.02)


@pytest.mark.compiled
def test_another_threshold_clusters_the_same_map_as_if_set_from_the_start(firings: list[Firing]) -> None:
    perception = perceived(firings)
    other = changed(clusters={"threshold_m": 0.25})
    before = perception.clusters.count
    perception.apply_settings(other)
    fresh = perceived(firings, other)
    np.testing.assert_array_equal(perception.outline.segments, fresh.outline.segments)
    assert perception.clusters.count == fresh.clusters.count != before
    many = fresh.clusters.count
    np.testing.assert_array_equal(perception.clusters.centres[:many], fresh.clusters.centres[:many])
    np.testing.assert_array_equal(perception.clusters.sizes[:many], fresh.clusters.sizes[:many])
    settle(perception)  # type: ignore[arg-type]
    assert perception.candidates.pending == 0


def test_smaller_clusters_get_candidates_once_allowed(firings: list[Firing]) -> None:
    perception = perceived(firings[:70])
    fewer = changed(clusters={"segments_min": 2})
    few = int((perception.candidates.rows["number"][: perception.clusters.count] > 0).sum())
    perception.apply_settings(fewer)
    sizes = perception.clusters.sizes[: perception.clusters.count]
    numbers = perception.candidates.rows["number"][: perception.clusters.count, 0]
    assert (numbers > 0).sum() == (sizes >= 2).sum() > few
    small = np.flatnonzero((sizes >= 2) & (sizes < SHIPPED.perception.clusters.segments_min))
    for j in small:
        off = perception.candidates.rows["pose"][j, 0, :2] - perception.clusters.centres[j]
        assert np.hypot(*off) < 0.5, "the candidate is placed at its cluster"
    perception.apply_settings(SHIPPED.perception)
    assert int((perception.candidates.rows["number"][: perception.clusters.count] > 0).sum()) == few


@pytest.mark.compiled
def test_new_segments_follow_the_new_settings(firings: list[Firing]) -> None:
    perception = perceived(firings[:60])
    perception.apply_settings(changed(segments={"baseline_min_m": 0.45, "baseline_max_m": 0.5}))
    total = perception.counts.segments_total
    for firing in firings[60:]:
        perception.observe(firing)
    assert perception.counts.segments_total - total < perceived(firings).counts.segments_total - total, (
        "fewer pairs have such a long baseline"
    )
