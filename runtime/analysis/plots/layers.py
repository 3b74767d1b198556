"""The layers of which figures of a run consist. Each `draw_` function draws one layer and returns its legend entries.

Each element gets an id in the SVG, by which a reader or a test finds it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch, Polygon
from matplotlib.path import Path
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D

from drivers.messages import Floats, Pose
from perception.detected_object import DetectedObject
from perception.mapping.grid.known_cells import UNKNOWN, KnownCells
from perception.polyline import Polyline
from runtime.analysis.plots.cross_arcs import cross_arcs
from runtime.analysis.plots.geometry import Frame, arcs, ellipse, outline, rotated, world_outlines
from runtime.analysis.plots.plot_style import (
    CLUSTER,
    CROSS,
    ECHO,
    FREE,
    INK,
    MODEL,
    MUTED,
    PAPER,
    ROBOT,
    SEGMENT,
    TRUTH,
)
from runtime.analysis.timeline import BookmarkEntry, Cluster, CrossPathRows, Echoes, Timeline
from runtime.simulation.evaluation import nearest_pairs
from runtime.simulation.open_loop import angular_places
from runtime.support.length_format import Units, format_length

ARCS_MAX: Final = 4000
"""Arcs drawn in a figure. More merge into a grey area and take megabytes."""


def draw_world(axes: Axes, timeline: Timeline, frame: Frame) -> list[Line2D]:
    """Draw the true world if it is known."""
    if timeline.world is None:
        return []
    closed, lines = world_outlines(timeline.world)
    outlines = [frame.world(points) for points in closed]
    polygons = PolyCollection(outlines, facecolor=TRUTH, edgecolor=MUTED, linewidth=1.0, alpha=0.55, zorder=1)
    polygons.set_gid("truth")
    axes.add_collection(polygons)
    handles = []
    if closed:
        handles.append(Line2D([], [], marker="o", markersize=9, linestyle="", markerfacecolor=TRUTH,
                              markeredgecolor=MUTED, label="truth"))  # fmt: skip
    if lines:
        walls = LineCollection([frame.world(points) for points in lines], color=MUTED, linewidth=2.5, zorder=1)
        walls.set_gid("truth-walls")
        axes.add_collection(walls)
        handles.append(Line2D([], [], color=MUTED, linewidth=2.5, label="true wall"))
    return handles


def draw_path(
    axes: Axes, poses: Sequence[Pose], frame: Frame, radius_m: float, end: Pose | None = None
) -> list[Line2D]:
    """Draw the path, and the robot at its last pose or at another `end`.

    The path is in odometry's frame.
    """
    if not poses:
        return []
    path = frame.points(np.array([(p.x, p.y) for p in poses]))
    (line,) = axes.plot(
        path[:, 0], path[:, 1], color=ROBOT, linewidth=1.6, linestyle=(0, (4, 2)), zorder=2, gid="path"
    )
    line.set_label("path by odometry")
    last = poses[-1] if end is None else end
    x, y = frame.points(np.array([[last.x, last.y]]))[0]
    body = Circle((x, y), radius_m / frame.unit_m, facecolor="none", edgecolor=ROBOT,
                  linewidth=1.6, zorder=5)  # fmt: skip
    body.set_gid("robot")
    axes.add_patch(body)
    nose = frame.points(rotated(np.array([[0.0, 0.0], [radius_m, 0.0]]), last.x, last.y, last.theta))
    axes.plot(nose[:, 0], nose[:, 1], color=ROBOT, linewidth=1.6, zorder=5, gid="heading")
    return [
        line,
        Line2D([], [], marker="o", markersize=9, linestyle="", markerfacecolor="none", markeredgecolor=ROBOT,
               markeredgewidth=1.6, label="robot at the end, its heading"),
    ]  # fmt: skip


def draw_bookmarks(axes: Axes, bookmarks: Sequence[BookmarkEntry], frame: Frame) -> list[Line2D]:
    """Draw the number of each bookmark at the robot's position at that moment.

    They are numbered from 1; one without a pose is not drawn.
    """
    style: Any = {"marker": "D", "markersize": 5, "linestyle": "", "color": PAPER, "markeredgecolor": INK}
    placed = [(number, mark.pose) for number, mark in enumerate(bookmarks, 1) if mark.pose is not None]
    for number, pose in placed:
        x, y = frame.points(np.array([[pose.x, pose.y]]))[0]
        axes.plot(x, y, zorder=9, gid=f"bookmark-{number}", **style)
        _label(axes, str(number), (x, y), 0.0, up=True)
    return [Line2D([], [], label="bookmark", **style)] if placed else []


def received_echoes(echoes: Echoes) -> Echoes:
    """Return the rows of echoes with a finite range, thinned evenly to at most `ARCS_MAX`."""
    return thinned(echoes[np.isfinite(echoes["range_m"])])


def thinned(rows: Echoes) -> Echoes:
    """Return rows of echoes or cross paths, thinned evenly to at most `ARCS_MAX`."""
    shown: Echoes = rows[:: max(1, math.ceil(len(rows) / ARCS_MAX))]
    return shown


def draw_evidence_grid(axes: Axes, known: KnownCells, frame: Frame) -> list[Line2D]:
    """Draw the cells of the evidence grid: occupied ones dark, free ones light, each as strongly as it is known.

    The grid is in odometry's frame.
    """
    rows, columns = known.percent.shape
    share = (known.percent.astype(np.float64) - 50.0) / 50.0
    pixels = np.zeros((rows, columns, 4))
    pixels[..., :3] = np.where((share > 0.0)[..., None], to_rgb(INK), to_rgb(FREE))
    pixels[..., 3] = np.where(known.percent == UNKNOWN, 0.0, np.abs(share))
    width, height = columns * known.cell_m, rows * known.cell_m
    corners = frame.points(np.array([[0.0, 0.0], [width, 0.0], [0.0, height]]) + np.array([known.x_m, known.y_m]))
    (x, y), along, up = corners[0], corners[1] - corners[0], corners[2] - corners[0]
    image = axes.imshow(pixels, origin="lower", extent=(0.0, 1.0, 0.0, 1.0), interpolation="nearest", zorder=0.5)
    placed = Affine2D(np.array([[along[0], up[0], x], [along[1], up[1], y], [0.0, 0.0, 1.0]]))
    image.set_transform(placed + axes.transData)
    image.set_gid("evidence-grid")
    style: Any = {"marker": "s", "markersize": 7, "linestyle": ""}
    return [Line2D([], [], color=INK, label="occupied", **style), Line2D([], [], color=FREE, label="free", **style)]


def draw_arcs(axes: Axes, echoes: Echoes, half_angle: float, frame: Frame) -> list[Line2D]:
    """Draw each echo as the arc on which its reflection may lie.

    The echoes have finite ranges; half the beam's opening is in rad.
    """
    curves = frame.points(arcs(echoes, half_angle))
    codes = np.tile([Path.MOVETO, Path.CURVE4, Path.CURVE4, Path.CURVE4], len(curves))
    if len(curves):
        patch = PathPatch(Path(curves.reshape(-1, 2), codes), facecolor="none", edgecolor=ECHO, linewidth=0.7,
                          alpha=0.4, zorder=3)  # fmt: skip
        patch.set_gid("echoes")
        axes.add_patch(patch)
    return [Line2D([], [], color=ECHO, linewidth=1.2, alpha=0.8, label="echo, its arc")]


def draw_cross_paths(axes: Axes, rows: CrossPathRows, half_angle: float, frame: Frame) -> list[Line2D]:
    """Draw each cross path as the arc of its ellipse.

    Rows are of `cross_arcs.heard_cross_paths`; half the beam's opening is in rad.
    """
    if not len(rows):
        return []
    curves = frame.points(cross_arcs(rows, half_angle))
    drawn = LineCollection(list(curves), colors=CROSS, linewidths=0.5, alpha=0.3, zorder=2.9, gid="cross-paths")
    axes.add_collection(drawn)
    return [Line2D([], [], color=CROSS, linewidth=1.2, alpha=0.8, label="cross path, its ellipse")]


def draw_segments(axes: Axes, segments: Floats, frame: Frame, *, faint: bool = False) -> list[Line2D]:
    """Draw outline segments, ends x, y, x, y (m); faint ones are thinner and paler."""
    lines = LineCollection(
        list(frame.points(segments.reshape(-1, 2, 2))), color=SEGMENT, linewidth=0.9 if faint else 1.3,
        alpha=0.45 if faint else 0.85, zorder=3,
    )  # fmt: skip
    lines.set_gid("segments")
    axes.add_collection(lines)
    return [Line2D([], [], color=SEGMENT, linewidth=1.5, label="outline segment")]


def draw_clusters(axes: Axes, clusters: Iterable[Cluster], least: int, frame: Frame) -> list[Line2D]:
    """Draw clusters as the paper does: a rectangle and an X at the centre; too small ones with dotted lines.

    Clusters are in odometry's frame; one needs `least` segments to be matched with a model.
    """
    handles = {}
    for number, cluster in enumerate(clusters, 1):
        large = cluster.segments >= least
        corners = np.array([[cluster.left, cluster.bottom], [cluster.right, cluster.bottom],
                            [cluster.right, cluster.top], [cluster.left, cluster.top]])  # fmt: skip
        style: Any = {"linewidth": 1.7 if large else 1.0, "linestyle": "-" if large else ":"}
        box = Polygon(frame.points(corners), closed=True, facecolor="none", edgecolor=CLUSTER, zorder=4, **style)
        box.set_gid(f"cluster-{number}")
        axes.add_patch(box)
        centre = frame.points(np.array([[cluster.x, cluster.y]]))[0]
        axes.plot(*centre, marker="x", color=CLUSTER, markersize=8 if large else 5, zorder=4,
                  markeredgewidth=style["linewidth"], linestyle="", gid=f"cluster-{number}-centre")  # fmt: skip
        label = "cluster, X its centre" if large else f"cluster of fewer than {least}"
        handles[label] = Line2D([], [], color=CLUSTER, marker="x", label=label, **style)
    return [handles[label] for label in sorted(handles)]


def draw_walls(axes: Axes, walls: Sequence[DetectedObject], frame: Frame) -> list[Line2D]:
    """Draw the recognised walls from end to end, each with its number.

    They are in odometry's frame.
    """
    style: Any = {"color": MODEL, "linewidth": 2.2, "linestyle": (0, (6, 1.5))}
    for index, wall in enumerate(walls, 1):
        ends = frame.points(np.array(wall.ends).reshape(2, 2))
        axes.plot(ends[:, 0], ends[:, 1], zorder=5, gid=f"wall-{index}", **style)
        if wall.number is not None:
            x, y = ends.mean(axis=0)
            _label(axes, str(wall.number), (x, y), 0.0, up=y < axes.viewLim.intervaly.mean())
    return [Line2D([], [], label="recognised wall, its number", **style)] if walls else []


def draw_polylines(axes: Axes, polylines: Sequence[Polyline], frame: Frame) -> list[Line2D]:
    """Draw what is not straight, thinner than walls; parameters as of `draw_walls`."""
    if not polylines:
        return []
    style: Any = {"color": MODEL, "linewidth": 1.1}
    chains = [frame.points(one.points) for one in polylines]
    axes.add_collection(LineCollection(chains, zorder=5, gid="polylines", **style))
    return [Line2D([], [], label="outline of what is not straight", **style)]


def draw_objects(
    axes: Axes,
    objects: Sequence[DetectedObject],
    timeline: Timeline,
    frame: Frame,
    units: Units,
    *,
    labelled: bool = True,
) -> list[Line2D]:
    """Draw the models at the recognised poses, with the error of each if the true world is known.

    Objects are in odometry's frame; errors are in `units`; names and errors are written where `labelled`.
    """
    models = {model.name: model for model in timeline.settings.models}
    whole = timeline.settings.perception.method == "bayes"
    known = match_to_truth(objects, timeline) if labelled else {}
    for number, seen in enumerate(objects, 1):
        points, closed = outline(seen, models.get(seen.model), whole=whole)
        shape = Polygon(frame.points(points), closed=closed, facecolor="none", edgecolor=MODEL, linewidth=2.2,
                        zorder=6)  # fmt: skip
        shape.set_gid(f"model-{number}")
        axes.add_patch(shape)
        around = ellipse(seen)
        if around is not None:
            sure = Polygon(frame.points(around), closed=True, facecolor=MODEL, edgecolor=MODEL, alpha=0.6, zorder=6)
            sure.set_gid(f"ellipse-{number}")
            axes.add_patch(sure)
        x, y = frame.points(np.array([[seen.x, seen.y]]))[0]
        axes.plot(x, y, marker="+", color=INK, markersize=7, markeredgewidth=1.2, zorder=7, linestyle="",
                  gid=f"centre-{number}")  # fmt: skip
        if labelled:
            model = models.get(seen.model)
            reach = 0.1 if model is None else model.reach_m
            one = known.get(number - 1)
            error = "" if one is None else f"\n{format_length(one.error_m, units, 3)} {units}"
            _label(
                axes,
                f"{seen.number or number if one is None else one.name}{error}",
                (x, y),
                reach / frame.unit_m,
                up=y >= axes.viewLim.intervaly.mean(),
            )
    if not objects:
        return []
    kind = "matched model, + its position" + (", its error" if known else "")
    handles = [Line2D([], [], color=MODEL, linewidth=2.2, marker="+", markeredgecolor=INK, label=kind)]
    if any(seen.covariance is not None for seen in objects):
        handles.append(Line2D([], [], marker="o", markersize=5, linestyle="", color=MODEL, alpha=0.6,
                              label="95 % ellipse of a position"))  # fmt: skip
    return handles


def _label(axes: Axes, text: str, at: tuple[float, float], reach: float, *, up: bool) -> None:
    """Write a label above or below an object, on the side away from the middle of the figure."""
    note = axes.annotate(
        text, (at[0], at[1] + (reach if up else -reach)), xytext=(0.0, 4.0 if up else -4.0),
        textcoords="offset points", ha="center", va="bottom" if up else "top", fontsize=8, zorder=8,
    )  # fmt: skip
    note.set_path_effects([withStroke(linewidth=2.5, foreground=PAPER)])


class MatchedObject(NamedTuple):
    """A true object that was recognised: its name as in Table 2, and the position error, m."""

    name: str
    error_m: float


def match_to_truth(objects: Sequence[DetectedObject], timeline: Timeline) -> dict[int, MatchedObject]:
    """Return the true object that each recognised one matches, by index; empty if the true world is not known."""
    if timeline.world is None:
        return {}
    placed = [timeline.start.compose(Pose(o.x, o.y, o.theta)) for o in objects]
    world = timeline.world
    truth = [*((d.x_m, d.y_m) for d in world.drum), *angular_places(world)]
    counted = {"drum": len(world.drum), "box": len(world.box), "polygon": len(world.polygon)}
    names = [f"{what} {i}" for what, count in counted.items() for i in range(1, count + 1)]
    pairs = nearest_pairs(truth, [(p.x, p.y) for p in placed])
    return {j: MatchedObject(names[i], math.dist(truth[i], (placed[j].x, placed[j].y))) for i, j in pairs.items()}
