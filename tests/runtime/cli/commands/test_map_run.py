"""Tests of `echolocate map`: the map of a recording and of a ring log, and calls that it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import load_world
from runtime.cli.app import run_command


def test_the_map_of_a_recording_is_a_world_that_can_be_loaded(
    hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, grid = tmp_path / "map.toml", tmp_path / "map.pgm"
    assert run_command(["map", str(hall_run), "--out", str(out), "--grid", str(grid)]) == DONE
    world = load_world(str(out))
    first, second = capsys.readouterr().out.splitlines()
    assert first == f"{out}: {len(world.drum)} drums, 0 polygons, {len(world.wall)} walls"
    assert len(world.drum) > 0
    assert second.startswith(f"{grid}: ")
    assert grid.read_bytes().startswith(b"P5\n")
    assert (tmp_path / "map.yaml").exists()


@pytest.mark.promise("P28")
def test_the_map_of_a_ring_log_whose_name_is_not_utf8(hall_log: Path, tmp_path: Path) -> None:
    out, log = tmp_path / "map.toml", tmp_path / "\udcff.csv"
    log.symlink_to(hall_log)
    assert run_command(["map", str(log), "--out", str(out)]) == DONE
    assert load_world(str(out)).drum
    assert out.read_text("utf-8").startswith("# Map of \\udcff.csv: ")


def test_calls_that_are_refused_name_the_cause(
    hall_log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for arguments, code, part in (
        ([str(hall_log), "--out", str(hall_log)], WRONG_CALL, "is an input itself"),
        ([str(tmp_path / "none.csv"), "--out", str(tmp_path / "map.toml")], WRONG_CALL, "none.csv"),
        ([str(hall_log), "--out", str(tmp_path / "no" / "map.toml")], FAILED, "cannot be written"),
    ):
        assert run_command(["map", *arguments]) == code, arguments
        err = capsys.readouterr().err
        assert err.startswith("echolocate: ")
        assert err.count("\n") == 1
        assert part in err
