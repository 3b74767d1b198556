"""Tests of `echolocate check`: every shipped file is good, and a warning does not make a file wrong."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE
from config.load import list_shipped
from runtime.cli.app import run_command

ROOT = Path(__file__).parents[4]
SHIPPED = sorted(path for path in (ROOT / "config").rglob("*.toml"))


@pytest.mark.parametrize("path", SHIPPED, ids=[f"{path.parent.name}/{path.name}" for path in SHIPPED])
def test_every_shipped_file_is_good(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", str(path)]) == DONE
    assert capsys.readouterr() == (f"{path}: good\n", "")


def test_every_shipped_run_is_good_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    for name in list_shipped("runs"):
        assert run_command(["check", name]) == DONE
        assert capsys.readouterr().out == f"{name}: good\n"


def test_an_unwise_setting_is_named_and_good(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_command(["check", "hallway", "--set", "cycle.rate_hz=5"]) == DONE
    warning, good = capsys.readouterr().out.splitlines()
    assert warning.startswith("hallway: cycle.rate_hz = 5")
    assert good == "hallway: good"
