"""Tests of `echolocate figures`: every file is there, and the folders that it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.analysis.plots import animation
from runtime.cli.app import run_command
from tests.runtime.analysis.plots.svg_ids import ids_in

PICTURES = ("raw", "segments", "clusters", "models")


@pytest.mark.compiled
def test_every_figure_of_a_recording_and_its_animation(
    hall_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The other formats of a figure are tested with `figure_files`."""
    monkeypatch.setattr(animation, "FRAMES_MAX", 2)
    monkeypatch.setattr("runtime.analysis.plots.figure_files.FORMATS", ("svg",))
    folder = tmp_path / "new" / "folder"
    assert run_command(["figures", str(hall_run), "--out", str(folder), "--units", "ft"]) == DONE
    files = {f"{name}.svg" for name in PICTURES}
    assert {path.name for path in folder.iterdir()} - {"overview.mp4"} == {*files, "overview.gif"}
    assert set(capsys.readouterr().out.splitlines()) == {str(path) for path in folder.iterdir()}
    shown = {name: (folder / f"{name}.svg").read_text("utf-8") for name in PICTURES}
    assert all({"truth", "path", "robot"} <= ids_in(svg) for svg in shown.values())
    assert all(len(svg) < 600_000 for svg in shown.values())
    assert {"model-3", "centre-3"} <= ids_in(shown["models"])
    assert "cluster-4-centre" in ids_in(shown["clusters"])


@pytest.mark.soak
def test_a_still_run_has_no_animation(hall_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn from a ring log, whose world is not known; one format is enough to see that."""
    monkeypatch.setattr("runtime.analysis.plots.figure_files.FORMATS", ("svg",))
    words = ["figures", str(hall_log), "--out", str(tmp_path), "--still", "--set", "perception.method=paper"]
    assert run_command(words) == DONE
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.svg" for name in PICTURES}
    ids = ids_in((tmp_path / "models.svg").read_text("utf-8"))
    assert "truth" not in ids
    assert "model-1" in ids


def test_folders_that_cannot_be_written(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    for out, code, piece in (("file", WRONG_CALL, "is a file"), ("file/deeper", FAILED, "cannot be written")):
        assert run_command(["figures", str(hall_run), "--out", str(tmp_path / out)]) == code
        err = capsys.readouterr().err
        assert piece in err
        assert (err.startswith("echolocate: "), err.count("\n")) == (True, 1)
