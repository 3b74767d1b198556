"""The layer of a figure that shows the way as known at the end: loop closures, and how sure each map of it is."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.lines import Line2D

from perception.localization.localized_pose import KnownWay
from runtime.analysis.plots.geometry import Frame, ellipse_95
from runtime.analysis.plots.plot_style import CLUSTER, INK, MUTED


def draw_known_way(axes: Axes, known: KnownWay, frame: Frame) -> list[Line2D]:
    """Draw the way as known at the end, its loop closures, and the uncertainty of each map of it.

    The way is in the map frame: the path by odometry begins where it does, and drifts away from it.
    """
    around = [frame.points(ellipse_95(*row)) for row in known.maps.tolist() if row[2] + row[4] > 0.0]
    axes.add_collection(PolyCollection(around, facecolors="none", edgecolors=MUTED, linewidths=0.5, gid="certainty"))
    path = frame.points(known.path)
    (line,) = axes.plot(path[:, 0], path[:, 1], color=INK, linewidth=1.4, zorder=3, gid="known-path")
    line.set_label("path as known at the end")
    handles = [line, Line2D([], [], color=MUTED, linewidth=0.5, label="uncertainty of a map")]
    if len(known.loops):
        ends = frame.points(known.loops.reshape(-1, 2)).reshape(-1, 2, 2)
        axes.add_collection(LineCollection(list(ends), colors=CLUSTER, linewidths=1.0, zorder=4, gid="loops"))
        handles.append(Line2D([], [], color=CLUSTER, linewidth=1.0, label="loop closure"))
    return handles
