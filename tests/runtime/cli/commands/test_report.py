"""Tests of `echolocate report`: the page of a recording, and the paths that it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command


@pytest.mark.compiled
def test_the_page_is_written_beside_the_recording(
    hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "hall.mcap"
    run.symlink_to(hall_run)
    assert run_command(["report", str(run), "--units", "ft"]) == DONE
    page = tmp_path / "hall.html"
    assert capsys.readouterr().out == f"{page}\n"
    text = page.read_text("utf-8")
    assert "as the paper&#x27;s Figure 6" in text or "as the paper's Figure 6" in text
    assert text.count("<svg") == 5


def test_refused_paths(hall_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    calls = (
        (["--out", str(tmp_path / "nowhere" / "x.html")], FAILED, "cannot be written"),
        (["--out", str(hall_run)], WRONG_CALL, "itself"),
        (["--model", "box"], WRONG_CALL, "--model"),
    )
    for words, code, piece in calls:
        assert run_command(["report", str(hall_run), *words]) == code
        err = capsys.readouterr().err
        assert piece in err
        assert (err.startswith("echolocate: "), err.count("\n")) == (True, 1)
