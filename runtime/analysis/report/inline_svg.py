"""SVG figures inside an HTML page: no header, unique ids, few digits, and the page's colours.

On a dark page the lines of a figure must be light, so its colours become CSS variables of the page.
"""

from __future__ import annotations

import re
from types import MappingProxyType
from typing import Final

from runtime.analysis.plots.plot_style import CLUSTER, ECHO, GRID, INK, MUTED, PAPER, ROBOT, SEGMENT, TRUTH

VARIABLES: Final = MappingProxyType(
    {
        INK: "--ink",
        MUTED: "--muted",
        GRID: "--grid",
        PAPER: "--paper",
        TRUTH: "--truth",
        ECHO: "--echo",
        SEGMENT: "--segment",
        CLUSTER: "--cluster",
        ROBOT: "--robot",
    }
)
TAG: Final = re.compile(r"<[^>]*>")
DIGITS: Final = re.compile(r"(\d\.\d\d)\d+")
"""Of coordinates, inside tags: the text between them is for people, and a tick of 0.0025 is not 0.00."""
COLOUR: Final = re.compile("|".join(map(re.escape, VARIABLES)))
FONT: Final = re.compile(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*")


def inlined(svg: str, prefix: str, label: str) -> str:
    """Return an SVG as an element of an HTML page.

    It is as matplotlib writes it, with text as text. The prefix makes ids unique in the page; the label is for screen
    readers, without quotes and angle brackets.
    """
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"\sxmlns(:\w+)?=\"[^\"]*\"", "", svg)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = svg.replace("xlink:href=", "href=")
    svg = re.sub(r"\bid=\"", f'id="{prefix}-', svg)
    svg = re.sub(r"href=\"#", f'href="#{prefix}-', svg)
    svg = re.sub(r"url\(#", f"url(#{prefix}-", svg)
    svg = TAG.sub(lambda tag: DIGITS.sub(r"\1", tag[0]), svg)
    svg = FONT.sub(r"font: \1system-ui, sans-serif", svg)
    svg = COLOUR.sub(lambda found: f"var({VARIABLES[found[0]]})", svg)
    svg = re.sub(r"\n\s*", "\n", svg)
    return svg.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)
