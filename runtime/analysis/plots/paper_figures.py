"""The four figures that the paper shows of each run: raw data, segments, clusters and matched models."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from config.load import load_world
from config.units import FOOT_M
from drivers.messages import Pose
from perception.detected_object import turned_object
from runtime.analysis.plots.cross_arcs import heard_cross_paths
from runtime.analysis.plots.geometry import Frame, window
from runtime.analysis.plots.known_way import draw_known_way
from runtime.analysis.plots.layers import (
    draw_arcs,
    draw_bookmarks,
    draw_clusters,
    draw_cross_paths,
    draw_evidence_grid,
    draw_objects,
    draw_path,
    draw_polylines,
    draw_segments,
    draw_walls,
    draw_world,
    received_echoes,
    thinned,
)
from runtime.analysis.plots.plot_style import MUTED, WIDTH_IN
from runtime.analysis.timeline import Timeline
from runtime.support.length_format import Units, format_length

NAMES: Final = ("raw", "segments", "clusters", "models")
"""The figures, in the paper's order."""
HEIGHT_MIN_IN, HEIGHT_MAX_IN = 3.0, 8.5
ROOM_IN: Final = 1.5
"""Height for the title and the line below it, axis label and legend."""


@dataclass(frozen=True, slots=True)
class Canvas:
    """The frame and the size of the figures of a run."""

    timeline: Timeline
    units: Units

    @property
    def frame(self) -> Frame:
        """The coordinates of the figures."""
        return Frame(self.timeline.start, FOOT_M if self.units == "ft" else 1.0)

    def figure(self, room_in: float = ROOM_IN) -> tuple[Figure, Axes]:
        """Return an empty figure with the run's proportions, plus `room_in` inches of height for text."""
        left, right, bottom, top = window(self.timeline, self.frame)
        height = (WIDTH_IN - 0.7) * (top - bottom) / (right - left) + room_in
        figure = Figure(figsize=(WIDTH_IN, min(max(height, HEIGHT_MIN_IN), HEIGHT_MAX_IN)), layout="constrained")
        axes = figure.add_subplot()
        self.prepare(axes)
        return figure, axes

    def prepare(self, axes: Axes) -> None:
        """Set the region, equal scales and labels of the axes."""
        left, right, bottom, top = window(self.timeline, self.frame)
        axes.set(xlim=(left, right), ylim=(bottom, top), xlabel=f"x ({self.units})", ylabel=f"y ({self.units})")
        axes.set_aspect("equal", adjustable="box")


def paper_figures(timeline: Timeline) -> tuple[int, int, int, int] | None:
    """Return the numbers of the paper's figures of the same scene; None if the paper does not show it."""
    for name, first in (("hallway", 6), ("irregular", 10)):
        if timeline.world is not None and timeline.world == load_world(name):
            return (first, first + 1, first + 2, first + 3)
    return None


def pictures(timeline: Timeline, units: Units) -> dict[str, Figure]:
    """Return the paper's four figures of the end of a run by name, and those of evidence grid and path if known."""
    canvas, last = Canvas(timeline, units), timeline.last
    if last is None:
        return {}
    numbers = paper_figures(timeline)
    half = math.radians(timeline.settings.ring.beam_half_angle_deg)
    least = timeline.settings.perception.clusters.segments_min
    arcs_shown = received_echoes(timeline.echoes)
    count, shown = int((timeline.echoes["range_m"] < math.inf).sum()), len(arcs_shown)
    few = f", {shown:,} of them drawn" if shown < count else ""
    crosses = heard_cross_paths(timeline.cross_paths)
    crosses_shown = thinned(crosses)
    if len(crosses):
        few += f"; {len(crosses):,} cross paths"
        few += f", {len(crosses_shown):,} drawn" if len(crosses_shown) < len(crosses) else ""
    method = "the Bayesian method" if timeline.settings.perception.method == "bayes" else "relaxation"
    frame = canvas.frame

    def raw(axes: Axes) -> list[Line2D]:
        return draw_arcs(axes, arcs_shown, half, frame) + draw_cross_paths(axes, crosses_shown, half, frame)

    def segments(axes: Axes) -> list[Line2D]:
        return draw_segments(axes, last.segments, frame)

    def clusters(axes: Axes) -> list[Line2D]:
        return draw_segments(axes, last.segments, frame, faint=True) + draw_clusters(
            axes, last.clusters, least, frame
        )

    def models(axes: Axes) -> list[Line2D]:
        handles = draw_segments(axes, last.segments, frame, faint=True) + draw_walls(axes, last.walls, frame)
        handles += draw_polylines(axes, last.polylines, frame)
        return handles + draw_objects(axes, last.objects, timeline, frame, units)

    layers = (
        ("Raw data", f"{count:,} echoes in {timeline.seconds:.0f} s{few}", raw),
        ("Segments", f"{len(last.segments):,} outline segments in the map", segments),
        ("Clusters", f"{counted(len(last.clusters), 'cluster')} of outline segments", clusters),
        (
            "Matched models",
            f"{counted(len(last.objects), 'model')} and {counted(len(last.walls), 'wall')} recognised, by {method}",
            models,
        ),
    )
    drawn = {}
    for at, (name, (title, line, draw)) in enumerate(zip(NAMES, layers, strict=True)):
        like = "" if numbers is None else f", as the paper's Figure {numbers[at]}"
        drawn[name] = _figure(canvas, f"{title}{like}", line, draw)
    if last.grid is not None and last.grid.percent.size:
        known = last.grid
        side = format_length(known.cell_m, units, 2)
        line = f"cells of {side} {units}, in the window around the robot"
        drawn["grid"] = _figure(canvas, "Evidence grid", line, lambda axes: draw_evidence_grid(axes, known, frame))
    if timeline.known_way is not None:
        known_way = timeline.known_way
        loops = counted(len(known_way.loops), "loop closure")
        line = f"{loops}; ellipses: uncertainty of each map, seen from the first; walls as corrected"
        to_map = timeline.odometry_from_map.inverse()
        walls = tuple(turned_object(to_map, wall) for wall in last.walls)
        drawn["path"] = _figure(
            canvas,
            "Path before and after its correction",
            line,
            lambda axes: draw_walls(axes, walls, frame) + draw_known_way(axes, known_way, frame),
            to_map,
        )
    return drawn


def _figure(
    canvas: Canvas, title: str, line: str, draw: Callable[[Axes], list[Line2D]], to_map: Pose | None = None
) -> Figure:
    """Return a figure with what `draw` draws, over the true world, the path, the robot and the bookmarks.

    With `to_map`, odometry's frame of the end in the map frame, the robot stands where it is in the map, and there
    are no bookmarks: only odometry's places of them are known.
    """
    figure, axes = canvas.figure()
    timeline, frame = canvas.timeline, canvas.frame
    handles = draw(axes)
    handles += draw_world(axes, timeline, frame)
    poses = [*(odometry.pose for _, odometry in timeline.odometry), *(m.pose for m in timeline.snapshots[-1:])]
    end = to_map.compose(poses[-1]) if to_map is not None and poses else None
    handles += draw_path(axes, poses, frame, timeline.settings.body.radius_m, end)
    if to_map is None:
        handles += draw_bookmarks(axes, timeline.bookmarks, frame)
    figure.suptitle(title, x=0.01, ha="left", fontsize=11.0, fontweight="bold")
    axes.set_title(line, loc="left", fontsize=8.5, fontweight="normal", color=MUTED)
    legend(figure, handles)
    return figure


def counted(number: int, what: str) -> str:
    """Return a number with its noun in the singular or plural."""
    return f"{number:,} {what}" if number == 1 else f"{number:,} {what}s"


def legend(figure: Figure, handles: Sequence[Line2D]) -> None:
    """Put the legend below the figure, where it hides nothing."""
    columns = {4: 2, 7: 4, 8: 4}.get(len(handles), min(len(handles), 3))
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns)
