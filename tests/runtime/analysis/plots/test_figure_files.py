"""Tests of the files of figures: every format is valid, and the same figure is the same bytes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from runtime.analysis.plots import figure_files
from runtime.analysis.plots.figure_files import FORMATS, save, styled, svg_of, undated
from runtime.analysis.plots.paper_figures import pictures
from tests.runtime.analysis.plots.svg_ids import ids_in
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline


def figure() -> Figure:
    return pictures(synthetic_timeline(), "ft")["models"]


@pytest.mark.compiled
def test_every_format_is_valid_and_the_same_run_is_the_same_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with styled():
        paths = save(figure(), tmp_path, "models")
        assert [path.name for path in paths] == ["models.svg", "models.pdf", "models.png"]
        svg, pdf, _png = (path.read_bytes() for path in paths)
        monkeypatch.setattr(figure_files, "FORMATS", ("svg", "pdf"))
        assert [path.read_bytes() for path in save(figure(), tmp_path, "again")] == [svg, pdf]
    assert {"truth", "model-1", "centre-1"} <= ids_in(svg.decode())
    assert b"<dc:date>" not in svg
    assert pdf.startswith(b"%PDF-")
    with Image.open(tmp_path / "models.png") as image:
        assert image.width > 1000
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
    assert 0.5 < (pixels == 255).all(axis=1).mean() < 0.99, "mostly paper, and not empty"


def test_text_stays_text_in_an_svg_for_a_page() -> None:
    with styled(text_as_text=True):
        text = svg_of(figure())
    assert ">truth</text>" in text


def test_no_format_has_a_date() -> None:
    for kind in FORMATS:
        metadata = undated(kind)
        assert not [key for key, value in metadata.items() if "Date" in key and value is not None]
