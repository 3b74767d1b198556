"""Tests of `echolocate map`: the map of a recording and of a ring log, and calls that it refuses."""

from __future__ import annotations

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import load_settings, load_world, with_known_room
from runtime.cli.app import run_command
from tests.polylines import BEND, report_bend
from tests.recorded import record


def beginning(log: Path, folder: Path) -> Path:
    """Return a ring log with the first third of another, where all of it shows no more."""
    rows = log.read_text("utf-8").splitlines(keepends=True)
    short = folder / "short.csv"
    short.write_text("".join(rows[: len(rows) // 3]), "utf-8")
    return short


def test_the_map_of_a_recording_is_a_world_that_can_be_loaded(
    hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, grid, geojson = (tmp_path / f"map.{suffix}" for suffix in ("toml", "pgm", "geojson"))
    command = ["map", str(hall_run), "--out", str(out), "--grid", str(grid), "--geojson", str(geojson)]
    assert run_command(command) == DONE
    world = load_world(str(out))
    first, features, second = capsys.readouterr().out.splitlines()
    assert first == f"{out}: {len(world.drum)} drums, 0 polygons, {len(world.wall)} walls"
    assert len(world.drum) > 0
    assert second.startswith(f"{grid}: ")
    assert grid.read_bytes().startswith(b"P5\n")
    assert (tmp_path / "map.yaml").exists()
    found = json.loads(geojson.read_text("utf-8"))
    assert features == f"{geojson}: {len(found['features'])} features"
    assert (len(found["features"]), found["frame"]) == (len(world.drum) + len(world.wall), "odom")


def test_a_polyline_is_on_the_map_as_its_pieces_of_wall(
    hall_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, grid = tmp_path / "map.toml", tmp_path / "map.pgm"
    command = ["map", str(beginning(hall_log, tmp_path)), "--out", str(out), "--grid", str(grid)]
    assert run_command(command) == DONE
    without = load_world(str(out))
    report_bend(monkeypatch)
    assert run_command([*command, "--force"]) == DONE
    world = load_world(str(out))
    assert world.drum == without.drum
    pieces = [[w.x1_m, w.y1_m, w.x2_m, w.y2_m] for w in world.wall if w not in without.wall]
    assert pieces == [[*a, *b] for a, b in itertools.pairwise(BEND.points.tolist())]
    columns, rows = map(int, grid.read_bytes().split(b"\n")[1].split())
    pixels = np.frombuffer(grid.read_bytes()[-rows * columns :], np.uint8).reshape(rows, columns)
    (origin,) = re.findall(r"origin: \[(.*?), (.*?),", grid.with_suffix(".yaml").read_text("utf-8"))
    along = np.concatenate([np.linspace(a, b, 30) for a, b in itertools.pairwise(BEND.points)])
    at = np.round((along - np.array(origin, float)) / 0.05).astype(int)  # it lies on the lines between pixels
    beside = [pixels[rows - 1 - at[:, 1] + below, at[:, 0] - left] for below in (0, 1) for left in (0, 1)]
    assert (np.min(beside, axis=0) == 0).all(), "occupied"


@pytest.mark.soak
def test_the_image_is_drawn_by_the_method_that_the_settings_name(hall_log: Path, tmp_path: Path) -> None:
    images, log = {}, beginning(hall_log, tmp_path)
    for method in ("off", "directed", "elfes"):
        grid = tmp_path / f"{method}.pgm"
        call = ["map", str(log), "--out", str(tmp_path / f"{method}.toml"), "--grid", str(grid)]
        assert run_command([*call, "--set", f"perception.grid.method={method}"]) == DONE
        images[method] = grid.read_bytes()
    assert images["off"] == images["directed"] != images["elfes"]


@pytest.mark.promise("P28")
def test_the_map_of_a_ring_log_whose_name_is_not_utf8(hall_log: Path, tmp_path: Path) -> None:
    out, log = tmp_path / "map.toml", tmp_path / "\udcff.csv"
    log.symlink_to(hall_log)
    assert run_command(["map", str(log), "--out", str(out)]) == DONE
    assert load_world(str(out)).drum
    assert out.read_text("utf-8").startswith("# Map of \\udcff.csv: ")


def _room(drums: str) -> str:
    return f"""
    drum = [{drums}]
    wall = [{{x1_m=-3.0, y1_m=-2.5, x2_m=6.0, y2_m=-2.5}}, {{x1_m=6.0, y1_m=-2.5, x2_m=6.0, y2_m=2.5}},
            {{x1_m=6.0, y1_m=2.5, x2_m=-3.0, y2_m=2.5}}, {{x1_m=-3.0, y1_m=2.5, x2_m=-3.0, y2_m=-2.5}}]
    start = {{x_m=-1.8, y_m=0.0, heading_deg=0.0}}
    """


@pytest.mark.compiled
def test_a_run_in_a_known_room_corrects_its_map_and_names_the_changes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    at = "{{x_m={}, y_m={}, radius_m=0.3048}}".format
    real, known, log = tmp_path / "real.toml", tmp_path / "known.toml", tmp_path / "run.mcap"
    real.write_text(_room(", ".join((at(0.4, 1.2), at(2.1, 1.2), at(2.1, -1.2)))), "utf-8")
    known.write_text(_room(", ".join((at(0.4, 1.2), at(2.9, -1.0), at(0.5, -1.3)))), "utf-8")
    record(with_known_room(load_settings("hallway", world=str(real)), str(known)), log, 24.0, refused=0.02)
    out, grid = tmp_path / "corrected.toml", tmp_path / "corrected.pgm"
    assert run_command(["map", str(log), "--out", str(out), "--grid", str(grid)]) == DONE
    written, *said, _ = capsys.readouterr().out.splitlines()
    assert written == f"{out}: 3 drums, 0 polygons, 4 walls"
    assert [line.split(" at ")[0] for line in said] == ["new: drum", "moved: drum", "gone: drum"]
    drums = sorted((round(drum.y_m, 1), drum.x_m) for drum in load_world(str(out)).drum)
    assert np.array(drums) == pytest.approx(np.array([(-1.2, 2.1), (1.2, 0.4), (1.2, 2.1)]), abs=0.02)
    assert grid.read_bytes().startswith(b"P5\n")


def test_a_robot_that_never_knew_its_place_corrects_no_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.mcap"
    record(with_known_room(load_settings("hallway"), "hallway"), log, 0.5)
    assert run_command(["map", str(log), "--out", str(tmp_path / "map.toml")]) == FAILED
    assert "never knew its place in the map" in capsys.readouterr().err


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
