"""Tests of the shapes: arcs by the definition of a cubic, frames, outlines, ellipses and the region to show."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from config.units import FOOT_M
from config.world import BoxConfig, DrumConfig, PolygonConfig, WallConfig, WorldConfig
from drivers.messages import Floats, Pose
from perception.detected_object import DetectedObject
from runtime.analysis.plots.geometry import MARGIN_M, Frame, arcs, ellipse, outline, window, world_outlines
from runtime.analysis.timeline import ECHO, Timeline
from tests.runtime.analysis.synthetic_timeline import SETTINGS, synthetic_timeline

MODEL = SETTINGS.models[0]
SEEN = DetectedObject("drum", 2.0, 1.0, math.pi, 0.0, 9, 1.0)


def curve_points(curves: Floats) -> Floats:
    """Return points along cubic Bézier curves, by their definition."""
    t = np.linspace(0.0, 1.0, 41)[:, None]
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    points: Floats = np.einsum("ktd,nkd->ntd", np.broadcast_to(weights, (4, 41, 2)), curves)
    return points


def test_an_arc_is_an_arc() -> None:
    echoes = np.array([(0.0, 0, 1.0, -2.0, 0.7, 3.0, 0.0), (0.0, 1, 0.0, 0.0, -2.0, 0.5, 0.0)], ECHO)
    points = curve_points(arcs(echoes, math.radians(12.0)))
    for row, curve in zip(echoes, points, strict=True):
        away = curve - (row["x"], row["y"])
        assert np.allclose(np.hypot(*away.T), row["range_m"], rtol=2e-6)
        turn = np.remainder(np.arctan2(away[:, 1], away[:, 0]) - row["bearing"] + math.pi, 2 * math.pi) - math.pi
        assert turn.min() == pytest.approx(-math.radians(12.0))
        assert turn.max() == pytest.approx(math.radians(12.0))


def test_recorded_arcs_touch_drums(timeline: Timeline) -> None:
    """Without noise the nearest rim is as far from every arc as a range is rounded."""
    assert timeline.world is not None
    heard = timeline.echoes[np.isfinite(timeline.echoes["range_m"])]
    half = math.radians(timeline.settings.ring.beam_half_angle_deg)
    points = Frame(timeline.start, 1.0).points(curve_points(arcs(heard, half)))
    drums = np.array([(d.x_m, d.y_m) for d in timeline.world.drum])
    rims = np.abs(np.linalg.norm(points[:, :, None] - drums, axis=-1) - 0.3048).min(axis=(1, 2))
    assert np.quantile(rims, 0.95) < 0.05


def test_a_frame_turns_shifts_and_scales() -> None:
    frame = Frame(Pose(-1.8288, 0.5, math.pi / 2), FOOT_M)
    (point,) = frame.points(np.array([[0.3048, 0.0]]))
    assert point == pytest.approx([-6.0, (0.5 + 0.3048) / 0.3048])
    assert frame.world(np.array([[0.3048, -0.6096]]))[0] == pytest.approx([1.0, -2.0])


def test_an_outline_is_the_model_at_its_pose_or_the_whole_circle() -> None:
    chords, closed = outline(SEEN, MODEL, whole=False)
    assert not closed
    assert np.allclose(np.hypot(*(chords - [2.0, 1.0]).T), 0.3048, atol=1e-5)
    assert (chords[:, 0] < 2.0 + 1e-9).all(), "turned by half a turn"
    circle, closed = outline(SEEN, MODEL, whole=True)
    assert closed
    assert np.allclose(np.hypot(*(circle - [2.0, 1.0]).T), 0.3048)
    unknown, closed = outline(SEEN, None, whole=False)
    assert closed
    assert np.allclose(np.hypot(*(unknown - [2.0, 1.0]).T), 0.1)


def test_an_ellipse_holds_95_per_cent() -> None:
    assert ellipse(SEEN) is None
    around = ellipse(replace(SEEN, covariance=(0.04, 0.0, 0.01)))
    assert around is not None
    away = around - [2.0, 1.0]
    # χ² with two degrees of freedom is 5.991 at 95 %.
    assert away[:, 0] ** 2 / 0.04 + away[:, 1] ** 2 / 0.01 == pytest.approx(np.full(len(away), 5.991))


def test_the_outlines_of_a_world() -> None:
    world = WorldConfig(
        drum=(DrumConfig(x_m=1.0, y_m=2.0, radius_m=0.5),),
        box=(BoxConfig(x_m=4.0, y_m=0.0, width_m=2.0, depth_m=1.0, angle_deg=90.0),),
        polygon=(PolygonConfig(vertices_m=((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))),),
        wall=(WallConfig(x1_m=-1.0, y1_m=0.0, x2_m=-1.0, y2_m=3.0),),
    )
    (drum, box, polygon), (wall,) = world_outlines(world)
    assert np.allclose(np.hypot(*(drum - [1.0, 2.0]).T), 0.5)
    assert sorted(map(tuple, np.round(box, 9).tolist())) == [(3.5, -1.0), (3.5, 1.0), (4.5, -1.0), (4.5, 1.0)]
    assert polygon.tolist() == [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    assert wall.tolist() == [[-1.0, 0.0], [-1.0, 3.0]]
    bent = world.wall[0].model_copy(update={"bend_m": 0.2})
    _, (points,) = world_outlines(world.model_copy(update={"wall": (bent,)}))
    assert points[:, 0].min() == pytest.approx(-1.2, abs=1e-3), "drawn as the emulated robot hears it"


def test_the_region_to_show_holds_the_world_or_else_the_segments() -> None:
    timeline = synthetic_timeline()
    frame = Frame(timeline.start, 1.0)
    assert timeline.world is not None
    _, right, bottom, top = window(timeline, frame)
    assert right == pytest.approx(max(d.x_m + d.radius_m for d in timeline.world.drum) + MARGIN_M, abs=1e-3)
    assert (bottom, top) == pytest.approx((-top, top), abs=1e-3)
    unknown = synthetic_timeline(with_world=False)
    assert unknown.last is not None
    left, right, bottom, top = window(unknown, Frame(unknown.start, 1.0))
    assert left < -SETTINGS.body.radius_m
    assert right == pytest.approx(unknown.last.segments[:, [0, 2]].max() + MARGIN_M)
    assert bottom < 0.0 < top
