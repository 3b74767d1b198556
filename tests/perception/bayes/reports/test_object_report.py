"""Reported objects against oracles on random cases: standard deviations, walls, and names of other objects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.parameters import PLACED_SIGMA_M, UNKNOWN_HITS_MIN
from perception.bayes.memory.polygon_parameters import POLYGON_INFLATION, POLYGON_TURN_SIGMA_RAD
from perception.bayes.memory.state import CONFIRMED, ESTABLISHED, FREE, PLACED, TENTATIVE, CircleTrack
from perception.bayes.reports import object_report
from perception.bayes.tracks.archived_tracks import archived_dtype, pack
from perception.detected_object import worst_sigma
from tests.perception.bayes.random_tracks import (
    BOXES,
    P,
    examples,
    new_memory,
)
from tests.perception.bayes.rooms import fill, keep, new_room, place_wall, reading


def test_a_post_at_the_end_of_a_wall_is_its_edge() -> None:
    surfaces = np.array([(0.0, 1.0, 2.0, 1.0), (5.0, 5.0, 5.0, 5.0)])  # a wall, and a corner
    assert object_report.wall_edge(surfaces, 2.08, 1.1, 0.1) == pytest.approx((2.08, 1.0))
    assert object_report.wall_edge(surfaces, -0.05, 0.93, 0.1) == pytest.approx((-0.05, 1.0))
    for x, y in ((1.0, 1.1), (2.3, 1.1), (2.08, 1.2), (5.0, 5.0)):
        assert object_report.wall_edge(surfaces, x, y, 0.1) is None
    assert object_report.wall_edge(np.empty((0, 4)), 2.08, 1.1, 0.1) is None


@pytest.mark.parametrize(
    ("spread_rad", "far", "silent", "is_corner"),
    [(1.2, 12, 0, True), (0.1, 12, 0, False), (1.2, 4, 0, False), (1.2, 4, 9, False)],
)
def test_a_point_between_mirrors_is_an_inside_corner_if_it_is_heard_from_afar_and_from_all_round(
    spread_rad: float, far: int, silent: int, *, is_corner: bool
) -> None:
    """Along one bearing the end of a wall is heard so far, too; silence from afar says nothing."""
    memory, _ = new_room()
    track, echoes = memory.tracks[0], []
    track.x, track.y = 1.0, 2.0
    for k in range(18):
        bearing, distance = math.pi + spread_rad * k / 17.0, 3.0 if k < far or k >= 18 - silent else 0.4
        x, y = 1.0 - distance * math.cos(bearing), 2.0 - distance * math.sin(bearing)
        echoes.append(reading(x, y, bearing, 2e6 if k >= 18 - silent else distance))
    keep(track, echoes)
    assert object_report.is_corner_of_mirrors(memory.circles[0]) == is_corner
    packed = pack(memory.circles[:1], archived_dtype(CircleTrack), is_reported=False)
    assert object_report.is_corner_of_mirrors(packed[0]) == is_corner


@examples(150, 1000)
def test_the_greatest_deviation_is_that_of_the_longest_axis(examples: int) -> None:
    rng = np.random.default_rng(18)
    for _ in range(examples):
        root = rng.normal(0, 1, (2, 2))
        cov = root @ root.T
        worst = math.sqrt(float(np.linalg.eigvalsh(cov)[1]))
        assert worst_sigma(cov[0, 0], cov[0, 1], cov[1, 1]) == pytest.approx(worst, rel=1e-12)


def test_other_objects_are_walls_rivals_and_unknown_objects_that_no_model_stands_on() -> None:
    memory = new_memory()
    model, edge = 0, int(P[0].model_count)
    for t, (status, kind, x, hits, probability) in enumerate(
        (
            (ESTABLISHED, edge, 0.0, 9.0, 0.95),
            (ESTABLISHED, edge, 2.0, 9.0, 0.5),
            (TENTATIVE, model, 4.0, 9.0, 0.25),
            (ESTABLISHED, edge, 6.0, UNKNOWN_HITS_MIN - 1.0, 0.95),
            (ESTABLISHED, edge, 8.1, 9.0, 0.95),
            (FREE, edge, 10.0, 9.0, 0.95),
        )
    ):
        track = memory.tracks[t]
        track.status, track.kind, track.x, track.hits, track.probability = status, kind, x, hits, probability
        track.radius = float(P[0].circles[kind].radius_m)
    named = [object_report.circle_object((8.0, 0.0, 0.1, 0.0, 0.1, 9.0, 1.0, 0.0), "semicircle", 0.9)]
    found = object_report.other_objects(memory, P, 0.9, named)
    assert [(o.model, o.x, o.probability) for o in found] == [
        ("edge", 0.0, 0.95), ("unknown", 2.0, 0.5), ("unknown", 4.0, 0.75),
    ]  # fmt: skip


def test_alternatives_are_labelled_in_their_order() -> None:
    assert object_report.alternative_labels(P, ["semicircle"]) == (
        "semicircle", "edge", "post", "barrel", "wall", "corner",
    )  # fmt: skip


def test_a_polygon_is_reported_with_its_least_heading_and_an_uncertain_one_with_a_users_deviation() -> None:
    memory, box_settings = new_memory(), make_settings(BOXES.ring, BOXES.models, BOXES.perception.bayes)
    track = memory.s[0].polygons[0]
    track.x, track.y, track.heading, track.number, track.marks = 1.0, 2.0, math.radians(170.0), 5, PLACED
    placed = object_report.polygon_object(track, box_settings, "box", 0.4)
    assert placed.theta == pytest.approx(math.radians(-10.0))
    assert (placed.sigma, placed.covariance) == (PLACED_SIGMA_M, None)
    assert (placed.number, placed.confirmed, placed.placed) == (5, False, True)
    assert placed.sigma_theta is None, "the readings do not support its heading yet"
    held = track.covariance
    held.xx, held.yx, held.yy, held.hx, held.hy, held.hh = 4e-4, 1e-4, 1e-4, 2e-5, 1e-5, 1e-4
    full = object_report.polygon_covariance(track)
    assert (full == full.T).all()
    expected = POLYGON_INFLATION * np.array([[4e-4, 1e-4, 2e-5], [1e-4, 1e-4, 1e-5], [2e-5, 1e-5, 1e-4]])
    expected[2, 2] += POLYGON_TURN_SIGMA_RAD**2
    assert full == pytest.approx(expected, rel=1e-12)
    assert object_report.polygon_object(track, box_settings, "box", 0.4).covariance is None, (
        "still where it was placed"
    )
    track.marks = CONFIRMED
    located = object_report.polygon_object(track, box_settings, "box", 0.4)
    assert located.covariance == (full[0, 0], full[0, 1], full[1, 1])
    assert located.sigma == pytest.approx(math.sqrt(np.linalg.eigvalsh(full[:2, :2])[1]))
    assert located.sigma_theta == pytest.approx(math.sqrt(full[2, 2]))


def test_a_hypothesis_whose_echoes_a_sure_wall_explains_is_not_reported_unless_a_user_marked_it() -> None:
    memory, room = new_room()
    place_wall(room.walls[0], np.zeros(2), 0.0, 2.0)
    fill(memory, room.walls[0], -1.0, 1.0)
    track = memory.tracks[0]
    track.status, track.kind, track.x, track.radius, track.hits = TENTATIVE, 0, 2.3, 0.3, 9.0
    track.probability = 0.1

    def labels() -> list[str]:
        return [seen.model for seen in object_report.other_objects(memory, P, 0.9, ())]

    echoes = [reading(1.0, y, 0.0, 1.0) for y in np.linspace(-0.1, 0.1, 8).tolist()]
    keep(track, echoes)
    assert labels() == ["wall"], "its echoes are the wall's"
    track.marks = PLACED
    assert labels() == ["wall", "unknown"]
    track.marks = 0
    keep(track, [reading(1.0, y, 0.0, 0.8) for y in np.linspace(-0.1, 0.1, 8).tolist()])
    track.x = 2.1
    assert labels() == ["wall", "unknown"], "before the wall"
