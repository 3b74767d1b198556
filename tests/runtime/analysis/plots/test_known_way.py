"""The way as known at the end: uncertainty of its maps, loop closures from place to place, in the figure's unit."""

from __future__ import annotations

import math

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from drivers.messages import Floats, Pose
from perception.localization.localized_pose import KnownWay
from runtime.analysis.plots.geometry import Frame
from runtime.analysis.plots.known_way import draw_known_way

FRAME = Frame(Pose(1.0, 0.0, 0.0), 0.5)
MAPS = np.array([[0.0, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.04, 0.0, 0.01]])


@pytest.mark.parametrize("loops", [np.zeros((0, 4)), np.array([[0.0, 0.0, 1.0, 0.0]])])
def test_it_shows_how_sure_places_are_and_which_were_matched(loops: Floats) -> None:
    axes = Figure().add_subplot()
    handles = draw_known_way(axes, KnownWay(MAPS[:, :2], MAPS, loops), FRAME)
    (ellipses,) = axes.findobj(PolyCollection)
    (path,) = ellipses.get_paths()  # the first map defines the frame
    high = np.max(np.abs(np.asarray(path.vertices) - FRAME.points(MAPS[1:, :2])), axis=0)
    assert high == pytest.approx(np.array([0.2, 0.1]) * math.sqrt(5.991) / FRAME.unit_m, rel=1e-3)
    drawn = [one for one in axes.findobj(LineCollection) if one.get_gid() == "loops"]
    assert [line.tolist() for one in drawn for line in one.get_segments()] == [[[2.0, 0.0], [4.0, 0.0]]] * len(loops)
    assert [one.get_label() for one in handles][2:] == ["loop closure"] * len(loops)
