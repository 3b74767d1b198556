"""Tests of the animation: frames of one size in which the models appear, as a GIF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from runtime.analysis.plots import animation
from runtime.analysis.plots.animation import frames, save_moving
from runtime.analysis.plots.figure_files import styled
from tests.runtime.analysis.synthetic_timeline import synthetic_timeline

MODEL_RGB = np.array([0x00, 0x72, 0xB2])
RUN = synthetic_timeline()


@pytest.fixture(autouse=True)
def _no_ffmpeg(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write the GIF only, also where ffmpeg is installed."""
    monkeypatch.setattr("runtime.analysis.plots.animation.shutil.which", lambda _name: None)


@pytest.mark.compiled
def test_models_appear_in_the_animation(tmp_path: Path) -> None:
    drawn: list[None] = []
    with styled():
        (path,) = save_moving(RUN, "ft", tmp_path, "overview", lambda: drawn.append(None))
    assert len(drawn) == len(RUN.snapshots)
    shown = []
    with Image.open(path) as film:
        assert getattr(film, "n_frames", 1) == len(RUN.snapshots)
        for k in (0, len(RUN.snapshots) - 1):
            film.seek(k)
            shown.append(np.asarray(film.convert("RGB")).astype(int))
    first, last = shown
    assert first.shape == last.shape
    assert (first[0, 0] == 255).all(), "paper stays white"
    assert 0.002 < (np.abs(first - last).sum(axis=2) > 60).mean() < 0.5
    blue = [(np.abs(image - MODEL_RGB).sum(axis=2) < 30).sum() for image in shown]
    assert blue[1] > blue[0] + 200, "models appear"


def test_a_long_run_has_few_frames_and_always_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(animation, "FRAMES_MAX", 2)
    run = synthetic_timeline()
    del run.snapshots[1]
    with styled():
        shown = list(frames(run, "m"))
    assert len(shown) == 2
    assert shown[0].shape == shown[1].shape
    assert shown[0].shape[0] % 2 == 0, "videos need even heights"


def test_a_run_without_a_snapshot_has_no_animation(tmp_path: Path) -> None:
    empty = synthetic_timeline()
    empty.snapshots.clear()
    assert save_moving(empty, "m", tmp_path, "overview") == []
    assert list(tmp_path.iterdir()) == []
