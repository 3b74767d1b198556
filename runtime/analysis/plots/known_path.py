"""The layer of a figure that shows the path as known at the end: loop closures, and how sure each place is."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D

from runtime.analysis.plots.geometry import Frame, circle
from runtime.analysis.plots.plot_style import CLUSTER, INK, MUTED
from runtime.analysis.timeline import KnownPath
from runtime.simulation.evaluation import CHI2_95


def draw_known_path(axes: Axes, known: KnownPath, frame: Frame) -> list[Line2D]:
    """Draw the path as known at the end, its loop closures, and the 95 % circle of each map of the way.

    The path is in odometry's frame of the end.
    """
    radius = math.sqrt(CHI2_95)
    around = [frame.points(circle(x, y, radius * sigma)) for x, y, sigma in known.maps.places.tolist() if sigma > 0.0]
    axes.add_collection(PolyCollection(around, facecolors="none", edgecolors=MUTED, linewidths=0.5, gid="certainty"))
    path = frame.points(known.places)
    (line,) = axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.4, zorder=3, gid="known-path")
    line.set_label("path as known at the end")
    handles = [line, Line2D([], [], color=MUTED, linewidth=0.5, label="95 % of a place")]
    if len(known.maps.loops):
        ends = frame.points(known.maps.loops.reshape(-1, 2)).reshape(-1, 2, 2)
        axes.add_collection(LineCollection(list(ends), colors=CLUSTER, linewidths=1.0, zorder=4, gid="loops"))
        handles.append(Line2D([], [], color=CLUSTER, linewidth=1.0, label="loop closure"))
    return handles
