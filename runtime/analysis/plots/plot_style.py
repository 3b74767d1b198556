"""The style of figures: Okabe-Ito colours, safe for colour-blind readers; colour is never the only difference."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, Final

INK: Final = "#1c1c1c"
MUTED: Final = "#6e6e6e"
GRID: Final = "#e3e3e3"
PAPER: Final = "#ffffff"
TRUTH: Final = "#cfcfcf"
"""The true world."""
ECHO: Final = "#0072b2"
CROSS: Final = "#566300"
SEGMENT: Final = "#d55e00"
CLUSTER: Final = "#009e73"
MODEL: Final = "#0072b2"
ROBOT: Final = "#cc79a7"
FREE: Final = "#56b4e9"

WIDTH_IN: Final = 7.2
"""Width of a figure: two columns of a page."""
DPI: Final = 200

RC: Final[MappingProxyType[str, Any]] = MappingProxyType(
    {
        "font.family": "DejaVu Sans",
        "font.size": 9.0,
        "axes.edgecolor": MUTED,
        "axes.labelcolor": INK,
        "axes.linewidth": 0.8,
        "axes.titlesize": 11.0,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.grid": True,
        "axes.axisbelow": True,
        "figure.facecolor": PAPER,
        "axes.facecolor": PAPER,
        "grid.color": GRID,
        "grid.linewidth": 0.6,
        "text.color": INK,
        "xtick.color": INK,
        "ytick.color": INK,
        "legend.frameon": False,
        "legend.fontsize": 8.5,
        "pdf.fonttype": 42,
        "svg.hashsalt": "echolocate",
    }
)
"""matplotlib's settings; `svg.hashsalt` makes the same run the same file."""
