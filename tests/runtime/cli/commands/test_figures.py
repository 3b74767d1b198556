"""Pictures: every file is there and shows what it should, of recordings and of ring logs."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from config.errors import DONE, FAILED, WRONG_CALL
from config.load import load_settings, load_world
from config.units import FOOT_M
from drivers.messages import Floats, Pose
from runtime.analysis.plots.geometry import Frame, arcs, outline
from runtime.analysis.timeline import ECHO, Timeline
from runtime.analysis.timeline_sources import TimelineSource, load_timeline
from runtime.cli.app import run_command

PICTURES = ("raw", "segments", "clusters", "models")
HALLWAY = load_world("hallway")


def ids(path: Path) -> set[str]:
    """Return the ids of the groups in an SVG."""
    return {element.attrib["id"] for element in ElementTree.parse(path).iter() if "id" in element.attrib}


def traced(path: Path, **asked: str) -> Timeline:
    return load_timeline(TimelineSource(str(path), **asked), lambda _settings: None)


@pytest.fixture(scope="module")
def drawn(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn") / "new" / "folder"
    assert run_command(["figures", str(hall_run), "--out", str(folder), "--units", "ft"]) == DONE
    return folder


def test_every_picture_in_every_form(drawn: Path) -> None:
    for name in PICTURES:
        assert (drawn / f"{name}.pdf").read_bytes().startswith(b"%PDF-")
        with Image.open(drawn / f"{name}.png") as image:
            assert image.width > 1000
            pixels = np.asarray(image.convert("RGB")).reshape(-1, 3)
        assert 0.5 < (pixels == 255).all(axis=1).mean() < 0.99, "mostly paper, and not nothing"
        text = (drawn / f"{name}.svg").read_text("utf-8")
        assert "truth" in ids(drawn / f"{name}.svg")
        assert {"path", "robot"} <= ids(drawn / f"{name}.svg")
        assert "<dc:date>" not in text
        assert len(text) < 600_000


def test_each_shows_its_own(drawn: Path) -> None:
    raw, segments, clusters, models = (ids(drawn / f"{name}.svg") for name in PICTURES)
    assert "echoes" in raw
    assert not raw & {"segments", "cluster-1", "model-1"}
    assert "segments" in segments
    assert "echoes" not in segments
    boxes = {name for name in clusters if re.fullmatch(r"cluster-\d+", name)}
    assert len(boxes) >= 4
    assert {f"{name}-centre" for name in boxes} <= clusters, "each with its X"
    seen = {name for name in models if re.fullmatch(r"model-\d+", name)}
    assert len(seen) >= 4
    assert {name.replace("model", "centre") for name in seen} <= models


@pytest.mark.compiled
def test_the_same_run_is_the_same_file(hall_run: Path, drawn: Path, tmp_path: Path) -> None:
    assert run_command(["figures", str(hall_run), "--out", str(tmp_path), "--units", "ft", "--still"]) == DONE
    assert not (tmp_path / "overview.gif").exists()
    for name in PICTURES:
        for kind in ("svg", "pdf"):
            file = f"{name}.{kind}"
            assert (tmp_path / file).read_bytes() == (drawn / file).read_bytes(), file


def test_the_overview_moves(drawn: Path) -> None:
    with Image.open(drawn / "overview.gif") as film:
        assert getattr(film, "n_frames", 1) >= 20
        shown = []
        for k in (0, getattr(film, "n_frames", 1) - 1):
            film.seek(k)
            shown.append(np.asarray(film.convert("RGB")).astype(int))
    first, last = shown
    assert first.shape == last.shape
    assert (first[0, 0] == 255).all(), "paper stays white"
    assert 0.002 < (np.abs(first - last).sum(axis=2) > 60).mean() < 0.5
    model = np.array([0x00, 0x72, 0xB2])
    blue = [(np.abs(image - model).sum(axis=2) < 30).sum() for image in shown]
    assert blue[1] > blue[0] + 200, "models appear"


def test_a_trace_holds_the_run(hall_run: Path) -> None:
    timeline = traced(hall_run)
    assert timeline.world == HALLWAY
    assert timeline.cycles == 280
    assert timeline.notes == []
    assert timeline.seconds == pytest.approx(13.95, abs=0.06)
    assert [entered.mode for entered in timeline.modes][-1] == "DRIVE"
    assert timeline.summary is not None
    times = [snapshot.t_s for snapshot in timeline.snapshots]
    assert times == sorted(times)
    assert times[-1] == timeline.seconds
    assert len(timeline.objects) >= 3
    heard = timeline.echoes[np.isfinite(timeline.echoes["range_m"])]
    half = math.radians(timeline.settings.ring.beam_half_angle_deg)
    # Without noise every arc touches a drum: its distance to the nearest rim is within the rounding of a range.
    points = trace_frame(timeline).points(curve_points(arcs(heard, half)))
    drums = np.array([(d.x_m, d.y_m) for d in HALLWAY.drum])
    rims = np.abs(np.linalg.norm(points[:, :, None] - drums, axis=-1) - 0.3048).min(axis=(1, 2))
    assert np.quantile(rims, 0.95) < 0.05


def trace_frame(timeline: Timeline) -> Frame:
    return Frame(timeline.start, 1.0)


def curve_points(curves: Floats) -> Floats:
    """Return points along cubic Bézier curves, by their definition."""
    t = np.linspace(0.0, 1.0, 41)[:, None]
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3])
    points: Floats = np.einsum("ktd,nkd->ntd", np.broadcast_to(weights, (4, 41, 2)), curves)
    return points


def test_an_arc_is_an_arc() -> None:
    echoes = np.array([(0.0, 0, 1.0, -2.0, 0.7, 3.0, 0.0), (0.0, 1, 0.0, 0.0, -2.0, 0.5, 0.0)], ECHO)
    points = curve_points(arcs(echoes, math.radians(12.0)))
    for row, curve in zip(echoes, points, strict=True):
        away = curve - (row["x"], row["y"])
        assert np.allclose(np.hypot(*away.T), row["range_m"], rtol=2e-6)
        turn = np.remainder(np.arctan2(away[:, 1], away[:, 0]) - row["bearing"] + math.pi, 2 * math.pi) - math.pi
        assert turn.min() == pytest.approx(-math.radians(12.0))
        assert turn.max() == pytest.approx(math.radians(12.0))


def test_frames_and_outlines() -> None:
    frame = Frame(Pose(-1.8288, 0.5, math.pi / 2), FOOT_M)
    (point,) = frame.points(np.array([[0.3048, 0.0]]))
    assert point == pytest.approx([-6.0, (0.5 + 0.3048) / 0.3048])
    from perception.detected_object import DetectedObject

    model = load_settings("hallway").models[0]
    seen = DetectedObject("semicircle", 2.0, 1.0, math.pi, 0.0, 9, 1.0)
    chords, closed = outline(seen, model, whole=False)
    assert not closed
    assert np.allclose(np.hypot(*(chords - [2.0, 1.0]).T), 0.3048, atol=1e-5)
    assert (chords[:, 0] < 2.0 + 1e-9).all(), "turned by half a turn"
    circle, closed = outline(seen, model, whole=True)
    assert closed
    assert np.allclose(np.hypot(*(circle - [2.0, 1.0]).T), 0.3048)


@pytest.mark.compiled
def test_a_ring_log_is_drawn_too(hall_log: Path, tmp_path: Path) -> None:
    arguments = ["figures", str(hall_log), "--out", str(tmp_path), "--still"]
    assert run_command([*arguments, "--world", "hallway", "--set", "perception.method=paper"]) == DONE
    assert {"truth", "model-1", "centre-1"} <= ids(tmp_path / "models.svg")
    assert run_command(arguments) == DONE
    assert "truth" not in ids(tmp_path / "raw.svg")


def lines(capsys: pytest.CaptureFixture[str]) -> Iterator[str]:
    err = capsys.readouterr().err
    assert err.startswith("echolocate: ")
    assert err.count("\n") == 1, err
    yield err


@pytest.mark.parametrize(
    ("command", "more"), [("figures", ["--out"]), ("report", ["--out"]), ("export", ["--to", "csv", "--out"])]
)
def test_files_that_cannot_be_shown(
    command: str, more: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {
        "empty.mcap": b"",
        "cut.mcap": b"\x89MCAP0\r\n",
        "wrong.mcap": b"hello\n",
        "empty.csv": b"",
        "wrong.csv": b"a,b\n1,2\n",
        "bare.csv": b"t,x,y,theta,r00\n",
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    for name in (*files, "nowhere.mcap", "nowhere.csv"):
        assert run_command([command, str(tmp_path / name), *more, str(tmp_path / "out")]) == WRONG_CALL
        assert name in next(lines(capsys))


def test_places_that_cannot_be_written(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    for command, more in (("figures", ()), ("export", ("--to", "csv"))):
        assert run_command([command, str(hall_run), *more, "--out", str(tmp_path / "file")]) == WRONG_CALL
        assert "is a file" in next(lines(capsys))
        assert run_command([command, str(hall_run), *more, "--out", str(tmp_path / "file" / "deeper")]) == FAILED
        assert "cannot be written" in next(lines(capsys))
    assert run_command(["report", str(hall_run), "--out", str(tmp_path / "nowhere" / "x.html")]) == FAILED
    assert "cannot be written" in next(lines(capsys))
    assert run_command(["report", str(hall_run), "--out", str(hall_run)]) == WRONG_CALL
    assert "itself" in next(lines(capsys))
    assert run_command(["report", str(hall_run), "--model", "box"]) == WRONG_CALL
    assert "--model" in next(lines(capsys))


def test_run_does_not_load_matplotlib() -> None:
    """It takes half a second to load, and a cycle does not use it; import-linter checks who imports it."""
    import subprocess
    import sys

    modules = "sys, runtime.cli.app, runtime.cycle.process, runtime.recording.recorder"
    code = f"import {modules}; assert 'matplotlib' not in sys.modules"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
