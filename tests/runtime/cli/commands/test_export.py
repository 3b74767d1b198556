"""Tests of `echolocate export`: each format from recordings and ring logs, and calls that it refuses."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cli.app import run_command
from runtime.cli.commands import export
from runtime.recording.ring_log import read_ring_log


def export_to(form: str, source: Path, out: Path) -> int:
    return run_command(["export", str(source), "--to", form, "--out", str(out)])


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    err = capsys.readouterr().err
    assert err.startswith("echolocate: ")
    assert err.count("\n") == 1, err
    return err


def test_a_recording_as_tables(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert export_to("csv", hall_run, tmp_path / "new") == DONE
    files = sorted((tmp_path / "new").iterdir())
    tables = ["cross_paths", "echoes", "objects", "odometry", "polylines", "segments", "walls"]
    assert [path.stem for path in files] == tables
    assert sorted(capsys.readouterr().out.splitlines()) == [str(path) for path in files]


def test_a_recording_as_a_ring_log(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "log.csv"
    assert export_to("ringlog", hall_run, path) == DONE
    count = len(list(read_ring_log(path)))
    assert count > 100
    assert capsys.readouterr().out == f"{path}: {count} firings\n"


@pytest.mark.soak
def test_a_ring_log_in_every_format(hall_log: Path, tmp_path: Path) -> None:
    """It has no odometry, no modes and no Unix time."""
    source = TimelineSource(str(hall_log), ["perception.method=paper"], world="hallway")
    timeline = load_timeline(source, lambda _settings: None)
    (tmp_path / "parquet").mkdir()
    for form in ("parquet", "foxglove", "rosbag2"):
        paths = export.write_timeline(timeline, form, tmp_path / form)
        assert paths
        assert all(path.exists() for path in paths)


@pytest.mark.parametrize("form", sorted(export.OPTIONAL_PACKAGES))
def test_a_missing_extra_is_one_line(
    form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module, package = export.OPTIONAL_PACKAGES[form]
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == module else find(name, *a))
    assert export_to(form, tmp_path / "any.mcap", tmp_path / "out") == FAILED
    err = error_line(capsys)
    assert "pip install 'echolocate[export]'" in err
    assert package in err


def test_a_ring_log_needs_no_conversion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x,y,theta,r00\n0,0,0,0,1\n", encoding="utf-8")
    assert export_to("ringlog", log, tmp_path / "x.csv") == WRONG_CALL
    assert "a ring log needs no conversion" in capsys.readouterr().err
    assert export_to("csv", log, log) == WRONG_CALL


def test_outputs_that_are_refused(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert export_to("csv", hall_run, tmp_path / "file") == WRONG_CALL
    assert "is a file" in error_line(capsys)
    assert export_to("csv", hall_run, tmp_path / "file" / "deeper") == FAILED
    assert "cannot be written" in error_line(capsys)
    assert export_to("rosbag2", hall_run, tmp_path) == WRONG_CALL
    assert "exists; a bag needs a new folder" in error_line(capsys)
