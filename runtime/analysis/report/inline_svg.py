"""Pictures within a page: SVG without headers, with ids of its own, few digits, and the page's colours.

In a page that is read in the dark a picture's ink must be light; so colours become the page's variables.
"""

from __future__ import annotations

import re
from types import MappingProxyType
from typing import Final

from runtime.analysis.plots.plot_style import CLUSTER, ECHO, GRID, INK, MUTED, PAPER, ROBOT, SEGMENT, THING

VARIABLES: Final = MappingProxyType(
    {
        INK: "--ink",
        MUTED: "--muted",
        GRID: "--grid",
        PAPER: "--paper",
        THING: "--thing",
        ECHO: "--echo",
        SEGMENT: "--segment",
        CLUSTER: "--cluster",
        ROBOT: "--robot",
    }
)
DIGITS: Final = re.compile(r"(\d\.\d\d)\d+")
COLOUR: Final = re.compile("|".join(map(re.escape, VARIABLES)))
FONT: Final = re.compile(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*")


def inlined(svg: str, prefix: str, told: str) -> str:
    """Return an SVG as an element of an HTML page.

    Parameters
    ----------
    svg : str
        As matplotlib writes it, its text as text.
    prefix : str
        Goes before its ids, which are then unique in the page.
    told : str
        What is to be seen, for those who do not see it; free of quotes and angle brackets.
    """
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"\sxmlns(:\w+)?=\"[^\"]*\"", "", svg)
    svg = re.sub(r"<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = svg.replace("xlink:href=", "href=")
    svg = re.sub(r"\bid=\"", f'id="{prefix}-', svg)
    svg = re.sub(r"href=\"#", f'href="#{prefix}-', svg)
    svg = re.sub(r"url\(#", f"url(#{prefix}-", svg)
    svg = DIGITS.sub(r"\1", svg)
    svg = FONT.sub(r"font: \1system-ui, sans-serif", svg)
    svg = COLOUR.sub(lambda found: f"var({VARIABLES[found[0]]})", svg)
    svg = re.sub(r"\n\s*", "\n", svg)
    return svg.replace("<svg", f'<svg role="img" aria-label="{told}"', 1)
