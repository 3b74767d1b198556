"""Settings of the kernels from ring, library and configuration: radii, outlines, sizes, symmetries, and limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from config.model import ModelConfig
from perception.bayes.inference.kernel_settings import (
    apply_config,
    apply_library,
    circle_models,
    copied,
    least_half_width,
    make_settings,
    polygon_symmetry,
)
from perception.bayes.memory.parameters import RIVAL_RADII_M
from perception.bayes.memory.settings_record import CIRCLES_MAX, NOISES, POLYGONS_MAX, SettingsRecord
from perception.kernel import Floats
from perception.records import array_of
from tests.perception.bayes.random_tracks import BOXES, numbers, unit

DRUM, BOX = BOXES.models
DRUM_RADIUS_M = DRUM.arc_radius_m or math.nan


def settings_of(*models: ModelConfig) -> SettingsRecord:
    """Return the settings of a library."""
    return make_settings(BOXES.ring, models, BOXES.perception.bayes)


def round_model(name: str, radius_m: float) -> ModelConfig:
    """Return a round model."""
    return DRUM.model_copy(update={"name": name, "arc_radius_m": radius_m})


def outline(vertices: list[tuple[float, float]], closed: bool = True) -> ModelConfig:
    """Return a model with this outline, m."""
    return ModelConfig(name="outline", vertices_m=tuple(vertices), closed=closed)


def regular(n: int, radius: float = 0.4, turn: float = 0.3) -> Floats:
    """Return the vertices of a regular polygon, counterclockwise."""
    return radius * unit(turn + 2.0 * math.pi * np.arange(n) / n)


def test_more_models_than_the_record_holds_are_refused() -> None:
    for model, most in ((DRUM, CIRCLES_MAX - 3), (BOX, POLYGONS_MAX)):
        radii = np.linspace(1.0, 3.0, most + 1).tolist() if model is DRUM else [None] * (most + 1)
        models = [model.model_copy(update={"name": f"m{k}", "arc_radius_m": r}) for k, r in enumerate(radii)]
        make_settings(BOXES.ring, models[:-1], BOXES.perception.bayes)
        with pytest.raises(ValueError, match="at a time; leave some out"):
            make_settings(BOXES.ring, models, BOXES.perception.bayes)


def test_a_round_model_is_listed_once_for_each_radius_and_in_their_order() -> None:
    models = [round_model("b", 0.5), round_model("a", 0.2), round_model("same", 0.5005), BOX]
    assert circle_models(models) == ([0.2, 0.5], ["a", "b"])


def test_rivals_follow_the_models_except_those_near_a_model() -> None:
    point, post, barrel = RIVAL_RADII_M
    for models, radii in (
        ((DRUM,), (DRUM_RADIUS_M, point, post, barrel)),
        ((DRUM, round_model("bollard", post + 0.02)), (post + 0.02, DRUM_RADIUS_M, point, barrel)),
        ((BOX,), (post, barrel, point)),
    ):
        p = settings_of(*models)
        assert [it.radius_m for it in p[0].circles[: p[0].circle_count]] == list(radii)
        assert p[0].model_count == sum(m is not BOX for m in models)
        assert p[0].polygon_count == sum(m is BOX for m in models)
        assert p[0].merge_m == pytest.approx(0.9 * radii[0])


@pytest.mark.parametrize(
    ("vertices", "order"),
    [
        *((regular(n), n) for n in (3, 4, 5, 6)),
        (np.array([(1.0, 0.3), (-1.0, 0.3), (-1.0, -0.3), (1.0, -0.3)]), 2),
        (np.add(regular(4), (0.1, 0.0)), 1),
        (np.array([(1.0, 0.0), (0.0, 1.0), (-0.4, -0.7)]), 1),
    ],
)
def test_the_symmetry_is_the_number_of_turns_that_leave_the_outline(vertices: Floats, order: int) -> None:
    assert polygon_symmetry(vertices) == order


def test_the_least_half_width_is_that_of_the_narrowest_strip_that_holds_the_outline() -> None:
    rng = np.random.default_rng(1)
    directions = unit(np.linspace(0.0, math.pi, 20_001))
    for n in (3, 4, 7):
        vertices = rng.uniform(-1.0, 1.0, (n, 2))
        across = vertices @ directions.T
        assert least_half_width(vertices) == pytest.approx(0.5 * np.ptp(across, axis=0).min(), abs=1e-4)
    assert least_half_width(regular(4, math.sqrt(0.5))) == pytest.approx(0.5)


def test_an_outlines_sides_run_counterclockwise_and_enclose_the_origin_at_its_inner_radius() -> None:
    square = [(0.3, -0.2), (0.3, 0.2), (-0.3, 0.2), (-0.3, -0.2)]
    for vertices in (square, square[::-1]):
        polygon = settings_of(outline(vertices))[0].polygons[0]
        assert (polygon.vertex_count, polygon.side_count, polygon.is_closed, polygon.symmetry) == (4, 4, 1, 2)
        assert polygon.inner_radius_m == pytest.approx(0.2)
        assert polygon.outer_radius_m == pytest.approx(math.hypot(0.3, 0.2))
        for side, following in itertools.pairwise(polygon.sides[:4]):
            end = side.x + side.length * side.tangent_x, side.y + side.length * side.tangent_y
            assert end == pytest.approx((following.x, following.y))
            assert side.x * side.tangent_y - side.y * side.tangent_x > 0.0, "the origin is on the left"


def test_an_open_outline_has_one_side_fewer_and_keeps_its_direction() -> None:
    chain = [(0.0, -0.5), (0.4, 0.0), (0.0, 0.5)]
    for vertices in (chain, chain[::-1]):
        polygon = settings_of(outline(vertices, closed=False))[0].polygons[0]
        assert (polygon.vertex_count, polygon.side_count, polygon.is_closed, polygon.symmetry) == (3, 2, 0, 1)
        assert [(side.x, side.y) for side in polygon.sides[:3]] == vertices


def test_the_chords_of_a_circle_close_and_touch_it_with_their_ends() -> None:
    p = settings_of(DRUM)
    radius = float(p[0].circles[0].radius_m)
    x, y, direction, length = array_of(p)["circles"]["chords"][0, 0].T
    half = 0.5 * length * unit(direction).T
    begins, ends = np.array([x, y]) - half, np.array([x, y]) + half
    assert np.hypot(*begins) == pytest.approx(radius)
    assert np.roll(ends, 1, axis=1) == pytest.approx(begins, abs=1e-12)


def test_the_beam_limits_the_resolution_and_the_noises_come_from_the_ring() -> None:
    p = settings_of(DRUM)
    s, half = p[0], math.radians(BOXES.ring.beam_half_angle_deg)
    assert s.cos_may_answer < s.cos_half_angle == math.cos(half) < s.cos_must_answer
    assert s.sin_must_answer == pytest.approx(math.sin(math.acos(s.cos_must_answer)))
    assert s.half_resolution_m == 0.5 * BOXES.ring.resolution_m
    assert s.range_max_m == BOXES.ring.range_max_m
    assert len({(it.absolute_m, it.relative) for it in s.noises}) == NOISES
    narrow = BOXES.ring.model_copy(update={"beam_half_angle_deg": 2.0})
    must = math.acos(make_settings(narrow, (DRUM,), BOXES.perception.bayes)[0].cos_must_answer)
    assert math.degrees(must) == pytest.approx(1.0), "at least half of a narrow beam"


def test_a_new_library_or_configuration_leaves_the_other_values_and_the_original() -> None:
    p = settings_of(DRUM, BOX)
    before = array_of(p).tobytes()
    other = copied(p)
    apply_library(other, (round_model("keg", 0.2),))
    apply_config(other, BOXES.perception.bayes.model_copy(update={"report_probability": 0.5}))
    assert array_of(p).tobytes() == before
    assert (other[0].model_count, other[0].polygon_count) == (1, 0)
    assert not numbers(array_of(other)["polygons"]["sides"][0, 0]).any()
    assert other[0].report_probability == 0.5
    assert other[0].report_probability_near <= 0.5
    assert array_of(other)["table"].tobytes() == array_of(p)["table"].tobytes()
