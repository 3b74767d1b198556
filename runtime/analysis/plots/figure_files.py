"""Pictures into files: SVG, PDF and PNG, the same run the same bytes."""

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
    """Draw in the house's style; text as paths, which look the same everywhere, or as text, which is small."""
    rc: Any = {**RC, "svg.fonttype": "none" if text_as_text else "path"}
    with mpl.rc_context(rc):
        yield


def undated(kind: str) -> dict[str, Any]:
    """Return what to tell of a file besides its picture: nothing that changes from day to day."""
    if kind == "svg":
        return {"Date": None, "Creator": None, "Format": None, "Type": None}
    return {"CreationDate": None, "Creator": "echolocate"} if kind == "pdf" else {"Software": "echolocate"}


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write a picture in every format and return the files.

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
    """Return a picture as the text of an SVG."""
    text = io.StringIO()
    figure.savefig(text, format="svg", metadata=undated("svg"), **TIGHT)
    return text.getvalue()
