"""The evidence grid as a page shows it: a message of its own, sent only to a client that asks for it."""

from __future__ import annotations

from base64 import b64encode
from typing import Final

from perception.mapping.grid.known_cells import known_cells
from runtime.console.sent_messages import GridMessage
from runtime.cycle.step import State

SIDE_MAX: Final = 256
"""Greatest number of rows and of columns: 64 KiB of cells."""


def grid_message(state: State) -> GridMessage:
    """Return the grid after a cycle; without cells where the settings keep none, or it knows nothing."""
    grid = state.perception.grid
    if grid is None:
        return {"type": "grid", "on": False, "columns": 0, "rows": 0, "cells": ""}
    window = None if state.percept is None else state.percept.occupancy  # a drive to a goal has just asked for it
    shown = known_cells(grid.occupancy() if window is None else window, SIDE_MAX)
    rows, columns = shown.percent.shape
    return {
        "type": "grid",
        "on": True,
        "x": round(shown.x_m, 3),
        "y": round(shown.y_m, 3),
        "cell": shown.cell_m,
        "columns": columns,
        "rows": rows,
        "cells": b64encode(shown.percent.tobytes()).decode("ascii"),
    }
