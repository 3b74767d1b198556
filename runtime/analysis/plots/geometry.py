"""Shapes to draw, as numbers: arcs of echoes, outlines of what stood there and of models, ellipses; no matplotlib."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.model import ModelConfig
from config.world import WorldConfig
from drivers.messages import Floats, Pose
from perception.detected_object import DetectedObject
from runtime.analysis.timeline import BEARING, RANGE, Timeline, X, Y
from runtime.simulation.evaluation import CHI2_95

MARGIN_M: Final = 0.45


@dataclass(frozen=True, slots=True)
class Frame:
    """The plane in which a picture is drawn: the odometry's, moved to the world's and measured in its unit."""

    start: Pose
    unit_m: float

    def points(self, xy: Floats) -> Floats:
        """Return points (…, 2) of the odometry's frame, m, in the picture's."""
        c, s = math.cos(self.start.theta), math.sin(self.start.theta)
        turned = xy @ np.array([[c, s], [-s, c]])
        placed: Floats = (turned + np.array([self.start.x, self.start.y])) / self.unit_m
        return placed

    def world(self, xy: Floats) -> Floats:
        """Return points of the world in the picture."""
        scaled: Floats = xy / self.unit_m
        return scaled


def arcs(echoes: Floats, half_angle: float) -> Floats:
    """Return the arc of each echo as one cubic Bézier curve: control points of shape (n, 4, 2), m.

    An arc of 24° is met by it to a millionth of its radius (handles of 4/3 tan(φ/4) radii, φ the whole angle).
    """
    radius, bearing = echoes[:, RANGE, None], echoes[:, BEARING, None]
    handle = 4.0 / 3.0 * math.tan(half_angle / 2.0)
    ends = bearing + half_angle * np.array([-1.0, 1.0])
    out = np.stack([np.cos(ends), np.sin(ends)], axis=-1)
    along = np.stack([-np.sin(ends), np.cos(ends)], axis=-1)
    first, last = out[:, 0], out[:, 1]
    unit = np.stack([first, first + handle * along[:, 0], last - handle * along[:, 1], last], axis=1)
    placed: Floats = echoes[:, None, (X, Y)] + radius[:, :, None] * unit
    return placed


def circle(x: float, y: float, radius: float, corners: int = 72) -> Floats:
    """Return a circle as a closed polygon."""
    turn = np.linspace(0.0, 2.0 * math.pi, corners, endpoint=False)
    return np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])


def rotated(points: Floats, x: float, y: float, theta: float) -> Floats:
    """Return points of a thing's own frame where it stands."""
    c, s = math.cos(theta), math.sin(theta)
    placed: Floats = points @ np.array([[c, s], [-s, c]]) + np.array([x, y])
    return placed


def things(world: WorldConfig) -> tuple[list[Floats], list[Floats]]:
    """Return what stands in a world: closed outlines, and lines, m."""
    closed = [circle(d.x_m, d.y_m, d.radius_m) for d in world.drum]
    for box in world.box:
        w, d = 0.5 * box.width_m, 0.5 * box.depth_m
        corners = np.array([[w, -d], [w, d], [-w, d], [-w, -d]])
        closed.append(rotated(corners, box.x_m, box.y_m, math.radians(box.angle_deg)))
    closed += [np.array(polygon.vertices_m) for polygon in world.polygon]
    return closed, [np.array([[w.x1_m, w.y1_m], [w.x2_m, w.y2_m]]) for w in world.wall]


def outline(seen: DetectedObject, model: ModelConfig | None, *, whole: bool) -> tuple[Floats, bool]:
    """Return the outline of an object where it was seen, and whether it is closed, m.

    Parameters
    ----------
    seen : DetectedObject
        The object.
    model : ModelConfig, optional
        Its model; without one a small circle marks it.
    whole : bool
        Draw an arc as the circle that it stands for: the Bayesian method locates circles, the paper's chords.
    """
    if model is None:
        return circle(seen.x, seen.y, 0.1), True
    if whole and model.arc_radius_m is not None:
        return circle(seen.x, seen.y, model.arc_radius_m), True
    return rotated(np.array(model.vertices_m), seen.x, seen.y, seen.theta), model.closed


def ellipse(seen: DetectedObject) -> Floats | None:
    """Return the 95 % ellipse of an object's place, m; None where its covariance is not known."""
    if seen.covariance is None:
        return None
    xx, xy, yy = seen.covariance
    values, vectors = np.linalg.eigh(np.array([[xx, xy], [xy, yy]]))
    axes = vectors * np.sqrt(CHI2_95 * np.maximum(values, 0.0))
    around: Floats = circle(0.0, 0.0, 1.0) @ axes.T + np.array([seen.x, seen.y])
    return around


def window(timeline: Timeline, frame: Frame) -> tuple[float, float, float, float]:
    """Return left, right, bottom, top of what must be seen, in the picture's unit."""
    margin = MARGIN_M / frame.unit_m
    reach = timeline.settings.body.radius_m / frame.unit_m + 0.3 * margin
    way = np.array([(m.pose.x, m.pose.y) for m in timeline.snapshots] or [(0.0, 0.0)])
    placed = frame.points(way)
    corners = [placed.min(axis=0) - reach, placed.max(axis=0) + reach]
    if timeline.world is not None:
        closed, lines = things(timeline.world)
        places = [frame.world(points) for points in (*closed, *lines)]
    else:
        rows = np.empty((0, 4)) if timeline.last is None else timeline.last.segments
        places = [frame.points(rows.reshape(-1, 2))] if len(rows) else []
    for points in places:
        corners += [points.min(axis=0) - margin, points.max(axis=0) + margin]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])
