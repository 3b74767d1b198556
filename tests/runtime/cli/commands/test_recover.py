"""Tests of `echolocate recover`: what it reports of a file that was cut off, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.cli.app import run_command
from runtime.cli.commands import recover
from runtime.recording.reader import open_recording


def test_a_recording_that_was_cut_off(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(run.read_bytes()[: run.stat().st_size * 3 // 4])
    assert run_command(["recover", str(cut)]) == DONE
    restored = tmp_path / "cut-recovered.mcap"
    last = capsys.readouterr().out.splitlines()[-1]
    with open_recording(restored) as recording:
        cycles = sum(1 for _ in recording.cycle_records())
        assert recording.corrupt_regions == []
    assert last.startswith(f"{restored}: {cycles} cycles, ")
    assert last.endswith("the original was not closed: the run or the file was cut off")
    assert run_command(["recover", str(run), "--out", str(tmp_path / "whole.mcap")]) == DONE
    assert capsys.readouterr().out.splitlines()[-1].endswith("the original was complete")


def test_many_damaged_places_are_not_all_listed(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(recover, "SHOWN_MAX", 0)
    damaged = bytearray(run.read_bytes())
    middle = len(damaged) // 2
    damaged[middle : middle + 64] = bytes(64)
    (tmp_path / "damaged.mcap").write_bytes(damaged)
    assert run_command(["recover", str(tmp_path / "damaged.mcap")]) == DONE
    more, _ = capsys.readouterr().out.splitlines()
    assert more.startswith("and ")
    assert more.endswith(" more")


def test_refused_outputs(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for out, code, piece in ((run, WRONG_CALL, "itself"), (tmp_path / "no" / "x", FAILED, "cannot be written")):
        assert run_command(["recover", str(run), "--out", str(out)]) == code
        err = capsys.readouterr().err
        assert piece in err
        assert (err.startswith("echolocate: "), err.count("\n")) == (True, 1)
