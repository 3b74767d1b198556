"""Shapes to draw, as arrays: arcs of echoes, outlines of the true world and of models, ellipses. No matplotlib."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.world import WorldConfig
from drivers.messages import Floats, Pose
from perception.detected_object import DetectedObject
from runtime.analysis.timeline import Echoes, Timeline
from runtime.simulation.evaluation import CHI2_95

MARGIN_M: Final = 0.45


@dataclass(frozen=True, slots=True)
class Frame:
    """The coordinates of a figure: world coordinates in the unit of its axes."""

    start: Pose
    unit_m: float

    def points(self, xy: Floats) -> Floats:
        """Return points (…, 2) of the odometry's frame (m) in the figure's coordinates."""
        c, s = math.cos(self.start.theta), math.sin(self.start.theta)
        turned = xy @ np.array([[c, s], [-s, c]])
        placed: Floats = (turned + np.array([self.start.x, self.start.y])) / self.unit_m
        return placed

    def world(self, xy: Floats) -> Floats:
        """Return points (…, 2) of the world (m) in the figure's coordinates."""
        scaled: Floats = xy / self.unit_m
        return scaled


def arcs(echoes: Echoes, half_angle: float) -> Floats:
    """Return the arc of each echo as one cubic Bézier curve: control points of shape (n, 4, 2), m.

    With handles of 4/3 tan(φ/4) radii, φ the whole angle (the standard approximation of a circular arc by one cubic),
    an arc of 24° is exact to a millionth of its radius.

    The echoes have finite ranges; half the beam's opening is in rad.
    """
    radius, bearing = echoes["range_m"][:, None], echoes["bearing"][:, None]
    handle = 4.0 / 3.0 * math.tan(half_angle / 2.0)
    ends = bearing + half_angle * np.array([-1.0, 1.0])
    out = np.stack([np.cos(ends), np.sin(ends)], axis=-1)
    along = np.stack([-np.sin(ends), np.cos(ends)], axis=-1)
    first, last = out[:, 0], out[:, 1]
    unit = np.stack([first, first + handle * along[:, 0], last - handle * along[:, 1], last], axis=1)
    placed: Floats = np.column_stack([echoes["x"], echoes["y"]])[:, None] + radius[:, :, None] * unit
    return placed


def circle(x: float, y: float, radius: float, corners: int = 72) -> Floats:
    """Return a circle (centre and radius, m) as a closed polygon, array (corners, 2)."""
    turn = np.linspace(0.0, 2.0 * math.pi, corners, endpoint=False)
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def rotated(points: Floats, x: float, y: float, theta: float) -> Floats:
    """Return points (n, 2) of an object's own frame in the frame in which it has the pose x, y, theta."""
    c, s = math.cos(theta), math.sin(theta)
    placed: Floats = points @ np.array([[c, s], [-s, c]]) + np.array([x, y])
    return placed


def world_outlines(world: WorldConfig) -> tuple[list[Floats], list[Floats]]:
    """Return the closed outlines (drums, boxes, polygons) and the lines (walls) of a world, each an array (n, 2)."""
    closed = [circle(d.x_m, d.y_m, d.radius_m) for d in world.drum]
    closed += [np.array(box.corners_m()) for box in world.box]
    closed += [np.array(polygon.vertices_m) for polygon in world.polygon]
    return closed, [np.array(wall.points_m()) for wall in world.wall]


def outline(seen: DetectedObject, model: ModelConfig | None, *, whole: bool) -> tuple[Floats, bool]:
    """Return the outline of a recognised object as points (n, 2) in m, and whether it is closed.

    Without a model it is a small circle. `whole`: of a model that is an arc, the whole circle, as the Bayesian method
    locates circles, and the paper's chords.
    """
    if model is None:
        return circle(seen.x, seen.y, 0.1), True
    if whole and model.arc_radius_m is not None:
        return circle(seen.x, seen.y, model.arc_radius_m), True
    return rotated(np.array(model.vertices_m), seen.x, seen.y, seen.theta), model.closed


def ellipse(seen: DetectedObject) -> Floats | None:
    """Return the 95 % confidence ellipse of an object's position as points (n, 2), m; None without a covariance."""
    return None if seen.covariance is None else ellipse_95(seen.x, seen.y, *seen.covariance)


def ellipse_95(x: float, y: float, xx: float, xy: float, yy: float) -> Floats:
    """Return the ellipse that holds 95 % of a place with a covariance (m²) as points (n, 2), m."""
    values, vectors = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    axes = vectors * np.sqrt(CHI2_95 * np.maximum(values, 0.0))
    around: Floats = circle(0.0, 0.0, 1.0) @ axes.T + np.array([x, y])
    return around


def window(timeline: Timeline, frame: Frame) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top of the region to show, in the figure's coordinates."""
    margin = MARGIN_M / frame.unit_m
    reach = timeline.settings.body.radius_m / frame.unit_m + 0.3 * margin
    way = np.array([(m.pose.x, m.pose.y) for m in timeline.snapshots] or [(0.0, 0.0)])
    if timeline.known_way is not None:
        way = np.concatenate([way, timeline.known_way.path])
    placed = frame.points(way)
    corners = [placed.min(axis=0) - reach, placed.max(axis=0) + reach]
    if timeline.world is not None:
        closed, lines = world_outlines(timeline.world)
        places = [frame.world(points) for points in (*closed, *lines)]
    else:
        rows = np.empty((0, 4)) if timeline.last is None else timeline.last.segments
        places = [frame.points(rows.reshape(-1, 2))] if len(rows) else []
    for points in places:
        corners += [points.min(axis=0) - margin, points.max(axis=0) + margin]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])
