"""A reload during a run is recorded as an input and replayed at its cycle."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.errors import DONE, FAILED
from runtime.analysis.comparison import compare_runs
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, KEYFRAME, RUN_INFO, SETTINGS, decode
from runtime.recording.reader import open_recording, parse_settings
from runtime.recording.schema import RunInfo, SettingsChange
from runtime.recording.verification import verify_recording
from tests.recorded import entries_of, hall, record, rewrite

AT = 150
OTHERS = {
    "bayes": ("perception.bayes.report_probability=0.5", "perception.bayes.attempts_per_firing=8"),
    "paper": (
        "perception.method=paper",
        "perception.map.age_max_s=2.0",
        "perception.recognition.support_min=0.1",
    ),
}
FASTER = "behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m=1.5"


@pytest.fixture(scope="module", params=["bayes", pytest.param("paper", marks=pytest.mark.soak)])
def reloaded(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reloaded") / "hall.mcap"
    before = hall(f"perception.method={request.param}")
    after = hall(f"perception.method={request.param}", *OTHERS[request.param], FASTER)
    status = record(before, path, 12.0, reloads={AT: after})
    assert status.dropped == 0
    return path


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [0.0, 9.0])
def test_replayed_to_the_bit_across_it(reloaded: Path, since_s: float) -> None:
    with open_recording(reloaded) as recording:
        result = verify_recording(recording, since_s=since_s)
    assert result.first_difference is None, str(result.first_difference)
    assert result.cycles >= 20 * (12.0 - since_s)
    assert result.missing == []


@pytest.mark.compiled
def test_it_is_recorded_and_in_force_from_its_cycle_on(reloaded: Path, tmp_path: Path) -> None:
    entries = entries_of(reloaded)
    (change,) = [decode(SettingsChange, e.data) for e in entries if e.topic == SETTINGS]
    assert change.cycle == AT
    where = [e.topic for e in entries].index(SETTINGS)
    assert sum(e.topic == CYCLE for e in entries[:where]) == AT - 1
    found = [parse_settings(decode(RunInfo, e.data).settings) for e in entries[where:] if e.topic == RUN_INFO]
    assert found
    assert all(t == parse_settings(change.settings) for t in found), "a replay may begin at any keyframe"
    # Without it the replay differs.
    first = entries[0]
    without = [e._replace(data=first.data) if e.topic == RUN_INFO else e for e in entries if e.topic != SETTINGS]
    rewrite(without, tmp_path / "without.mcap")
    with open_recording(tmp_path / "without.mcap") as recording:
        result = verify_recording(recording)
    assert result.first_difference is not None
    assert result.first_difference.cycle >= AT


@pytest.mark.compiled
def test_a_comparison_follows_it(reloaded: Path) -> None:
    with open_recording(reloaded) as recording:
        found = compare_runs(recording, recording.settings)
    assert found.first_change_s is not None
    assert found.first_change_s >= (AT - 1) / 20.0 - 0.1


def test_a_run_without_a_cycle_is_reported_plainly(
    reloaded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, summary = tmp_path / "none.mcap", tmp_path / "none.json"
    entries = entries_of(reloaded)
    rewrite(entries[:1], path)
    assert run_command(["replay", str(path), "--verify", "--json", str(summary)]) == DONE
    assert "holds no cycle yet" in capsys.readouterr().err
    assert '"cycles": 0' in summary.read_text()
    assert run_command(["replay", str(path), "--from", "3"]) == FAILED
    assert "no cycle that can be replayed" in capsys.readouterr().err
    last = max(i for i, e in enumerate(entries) if e.topic == KEYFRAME)
    rewrite([entries[0], *entries[last + 3 :]], path)
    assert run_command(["replay", str(path), "--verify"]) == FAILED, "there are cycles, and none can be compared"
