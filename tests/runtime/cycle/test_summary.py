"""Tests of the summaries: public keys, numbers that survive JSON, and errors that name the path."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import get_type_hints

import pytest

from config.errors import FAILED, UserError
from perception.pipeline import DetectedObject
from runtime.cycle.summary import LinkRow, ObjectRow, RunSummary, object_row, write_json
from runtime.recording.replay_summary import ReplaySummary
from runtime.simulation.evaluation import DrumRow, Outcome

SEEN = DetectedObject("semicircle", 1.0, -2.0, 0.1 + 0.2, 1e-17, 39, 2.0 / 3.0)


def test_the_summaries_have_the_fields_of_the_public_surface() -> None:
    assert list(get_type_hints(ObjectRow))[:7] == ["model", "x", "y", "theta", "sigma", "support", "score"]
    assert {"objects", "cycles", "cycle_us", "late", "link", "mode", "stop_reasons", "timing"} <= set(
        get_type_hints(RunSummary)
    )
    assert set(get_type_hints(LinkRow)) == {"frames", "bad", "lost"}
    assert {"objects", "segments", "clusters", "cycles", "cycle_us"} <= set(get_type_hints(ReplaySummary))
    assert {"drums", "false", "mean_error", "max_error", "times_real_time"} <= set(get_type_hints(Outcome))
    assert set(get_type_hints(DrumRow)) == {"truth", "estimate", "error"}


def test_an_object_survives_json_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "summary.json"
    write_json(str(path), {"objects": [object_row(SEEN)], "estimate": None, "nan": math.nan})
    text = path.read_text("utf-8")
    assert text.endswith("}\n")
    read = json.loads(text)
    assert read["objects"] == [
        {"model": "semicircle", "x": 1.0, "y": -2.0, "theta": 0.1 + 0.2, "sigma": 1e-17, "support": 39,
         "score": 2.0 / 3.0}
    ]  # fmt: skip
    assert read["estimate"] is None
    assert read["nan"] is None, "JSON has no NaN"


@pytest.mark.parametrize("name", ["", "file/summary.json", "nowhere/summary.json"])
def test_a_file_that_cannot_be_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").touch()
    path = str(tmp_path / name)
    with pytest.raises(UserError, match=r"^--json .* cannot be written: .*; choose another file$") as caught:
        write_json(path, {})
    assert caught.value.exit_code == FAILED
    assert path in str(caught.value)
