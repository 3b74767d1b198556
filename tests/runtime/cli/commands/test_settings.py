"""`echolocate settings`: found by a text, or all as a page."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, WRONG_CALL
from config.reference import markdown
from runtime.cli.app import run_command


def test_a_setting_is_found_by_its_name_and_by_its_meaning(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["settings", "CLEARANCE_m"]) == DONE
    by_name = capsys.readouterr().out
    assert "behaviors.arbiter.clearance_m = 0.16" in by_name
    assert "run file: number, ≥ 0, ≤ 10" in by_name
    assert run_command(["settings", "base can still stop"]) == DONE
    assert capsys.readouterr().out == by_name


def test_a_text_that_no_setting_contains(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["settings", "warp_drive"]) == WRONG_CALL
    assert "no setting contains 'warp_drive'" in capsys.readouterr().err


def test_the_page_of_all_keys_is_not_written_for_a_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["settings", "clearance_m", "--out", str(tmp_path / "page.md")]) == WRONG_CALL
    assert "leave out either" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_page_is_written_and_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "settings.md"
    assert run_command(["settings", "--out", str(page)]) == DONE
    assert page.read_text("utf-8") == markdown()
    assert run_command(["settings", "--out", str(page)]) == WRONG_CALL
    assert "--force" in capsys.readouterr().err
    assert run_command(["settings", "--out", str(tmp_path / "no" / "page.md")]) != DONE
    assert "cannot be written" in capsys.readouterr().err
