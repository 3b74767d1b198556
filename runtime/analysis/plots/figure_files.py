"""Figures as SVG, PDF and PNG files. The same run gives the same bytes."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import matplotlib as mpl
from matplotlib.figure import Figure

from runtime.analysis.plots.plot_style import DPI, RC

FORMATS: Final = ("svg", "pdf", "png")
TIGHT: Final[MappingProxyType[str, Any]] = MappingProxyType({"bbox_inches": "tight", "pad_inches": 0.06})


@contextlib.contextmanager
def styled(*, text_as_text: bool = False) -> Iterator[None]:
    """Apply this program's style to figures drawn inside; text as paths looks the same everywhere but is larger."""
    rc: Any = {**RC, "svg.fonttype": "none" if text_as_text else "path"}
    with mpl.rc_context(rc):
        yield


def undated(kind: str) -> dict[str, Any]:
    """Return the metadata of a file of this format, without a date, so that it never changes."""
    if kind == "svg":
        return {"Date": None, "Creator": None, "Format": None, "Type": None}
    return {"CreationDate": None, "Creator": "echolocate"} if kind == "pdf" else {"Software": "echolocate"}


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a figure in every format and return the files.

    The name has no suffix.

    Raises
    ------
    OSError
        A file cannot be written.
    """
    paths = [folder / f"{name}.{kind}" for kind in FORMATS]
    for path, kind in zip(paths, FORMATS, strict=True):
        figure.savefig(path, format=kind, dpi=DPI, metadata=undated(kind), **TIGHT)
    return paths


def svg_of(figure: Figure) -> str:
    """Return a figure as the text of an SVG."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=undated("svg"), **TIGHT)
    return text.getvalue()
