"""The message of the evidence grid: its cells are those of the grid, and its size is bounded."""

from __future__ import annotations

from base64 import b64decode

import numpy as np
import orjson
import pytest

from drivers.messages import Pose
from runtime.console.frames import grid_message as module
from runtime.console.frames.grid_message import grid_message
from tests.runtime.cycle.requested_robot import RequestedRobot, driving

GRID = ("perception.grid.method=directed", "perception.grid.cells=32", "perception.grid.cell_m=0.3")


def heard(*sets: str) -> RequestedRobot:
    script = driving(*sets)
    for k in range(5):
        script.move_to(Pose(0.1 * k, 0.0, 0.0))
    return script


@pytest.mark.compiled
def test_the_cells_are_those_of_the_grid(monkeypatch: pytest.MonkeyPatch) -> None:
    state = heard(*GRID).state
    message = grid_message(state)
    assert state.perception.grid is not None
    window = state.perception.grid.occupancy()
    cells = np.frombuffer(b64decode(message["cells"]), np.int8).reshape(message["rows"], message["columns"])
    left = round((message["x"] - window.x_m) / window.cell_m)
    low = round((message["y"] - window.y_m) / window.cell_m)
    part = window.occupied[low : low + message["rows"], left : left + message["columns"]]
    assert (cells == np.where(part == 0.5, -1, np.rint(100 * part))).all()
    assert (cells > 50).any()
    assert (cells >= 0).sum() == (window.occupied != 0.5).sum(), "nothing known is left out"
    monkeypatch.setattr(module, "SIDE_MAX", 8)
    small = grid_message(state)
    assert max(small["columns"], small["rows"]) <= 8
    assert len(orjson.dumps(small)) < 400


def test_without_a_grid_it_says_so() -> None:
    assert grid_message(heard().state) == {"type": "grid", "on": False, "columns": 0, "rows": 0, "cells": ""}
