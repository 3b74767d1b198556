"""Tests of `echolocate figures`: every file is there, and paths that cannot be read or written are refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.analysis.plots import animation
from runtime.cli.app import run_command

PICTURES = ("raw", "segments", "clusters", "models")


def ids(path: Path) -> set[str]:
    """Return the ids of the groups in an SVG."""
    return {element.attrib["id"] for element in ElementTree.parse(path).iter() if "id" in element.attrib}


@pytest.fixture(scope="module")
def drawn(hall_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("drawn") / "new" / "folder"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(animation, "FRAMES_MAX", 2)
        assert run_command(["figures", str(hall_run), "--out", str(folder), "--units", "ft"]) == DONE
    return folder


def test_every_picture_in_every_form(drawn: Path) -> None:
    assert (drawn / "overview.gif").exists()
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
