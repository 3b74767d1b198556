"""A replay equals the run to the bit, from the beginning or a keyframe; a difference is reported with its place."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import DONE
from runtime.cycle.preparation import fresh_state
from runtime.recording.channels import CYCLE, KEYFRAME, decode, encode
from runtime.recording.schema import Cycle, Keyframe, keyframe, perception_snapshot, state_fields
from runtime.recording.verification import (
    ABSENT,
    GAPS_MAX,
    ReplayResult,
    find_difference,
    refused_lines,
    without_later,
)
from tests.recorded import SECONDS, entries_of, hall, record, rewrite, spoil, verify_file

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def whole(run: Path) -> ReplayResult:
    return verify_file(run)


@pytest.mark.compiled
def test_a_replay_is_the_run_to_the_bit(whole: ReplayResult) -> None:
    result = whole
    assert result.first_difference is None, str(result.first_difference)
    assert (result.cycles, result.differences, result.first_cycle) == (20 * SECONDS, 0, 1)
    assert set(result.refinement_stops) >= {"budget", "converged", "nothing"}
    assert result.keyframes >= SECONDS / 2.0 - 2
    assert result.missing == []
    assert result.state is not None
    assert len(result.state.perception.objects()) >= 3


@pytest.mark.compiled
@pytest.mark.parametrize("since_s", [4.5, 11.0])
def test_a_replay_from_a_keyframe_is_the_run_to_the_bit(run: Path, whole: ReplayResult, since_s: float) -> None:
    part = verify_file(run, since_s=since_s)
    assert part.first_difference is None, str(part.first_difference)
    assert part.first_cycle is not None
    assert 20 * (since_s - 2.1) <= part.first_cycle <= 20 * since_s + 2
    assert part.cycles == 20 * SECONDS - part.first_cycle + 1
    assert whole.state is not None
    assert part.state is not None
    assert part.state.perception.objects() == whole.state.perception.objects()
    one, other = whole.state.perception.snapshot(), part.state.perception.snapshot()
    assert {name: array.tobytes() for name, array in one.items()} == {n: a.tobytes() for n, a in other.items()}


@pytest.mark.compiled
def test_a_replay_in_another_process_is_the_run_to_the_bit(run: Path, tmp_path: Path) -> None:
    """From the beginning, and from a keyframe."""
    summaries = {since: tmp_path / f"{since}.json" for since in (0, 9)}
    calls = [["replay", str(run), "--verify", "--from", str(k), "--json", str(p)] for k, p in summaries.items()]
    program = f"from runtime.cli.app import run_command\nfor call in {calls!r}: assert run_command(call) == {DONE}"
    done = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True,
        text=True, timeout=600, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    for since, path in summaries.items():
        found = json.loads(path.read_bytes())
        assert found["verify"]["differences"] == 0
        assert found["cycles"] >= 20 * (SECONDS - since)


@pytest.mark.soak
@pytest.mark.compiled
def test_a_replay_by_the_papers_method_is_the_run_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "paper.mcap"
    record(hall("perception.method=paper"), path, 10.0)
    for since_s in (0.0, 5.0):
        result = verify_file(path, since_s=since_s)
        assert result.first_difference is None, str(result.first_difference)
        assert result.cycles >= 20 * (10.0 - since_s)
        assert set(result.refinement_stops) >= {"budget", "converged", "nothing"}


@pytest.mark.compiled
def test_a_part_begins_at_an_earlier_keyframe_where_the_last_one_is_refused(run: Path, tmp_path: Path) -> None:
    path = tmp_path / "spoiled.mcap"
    frames, gap = spoil(run, path, {1, 2}), tmp_path / "gap.mcap"
    spoil(run, gap, {1, 2}, lost={frames[0] + 5})
    for since_s, first, refused in (
        (0.05 * frames[3] + 0.1, frames[3] + 1, 0),
        (0.05 * frames[3] - 0.1, frames[0] + 1, 2),
    ):
        part = verify_file(path, since_s=since_s)
        assert (part.first_cycle, len(part.refused)) == (first, refused)
        assert part.cycles == 20 * SECONDS - first + 1
        assert part.differences == (2 if refused else 0), "they differ from the state that they should hold"
    assert len(verify_file(gap, since_s=0.05 * frames[3] - 0.1).refused) == 2, "met twice, noted once"
    assert refused_lines([]) == []
    (line,) = refused_lines(part.refused)
    assert "firings is -7, expected 0 to 9.0072e+15, and 1 more" in line


@pytest.mark.compiled
def test_the_first_difference_is_named(run: Path, tmp_path: Path) -> None:
    entries = entries_of(run)
    for i, entry in enumerate(entries):
        if entry.topic == CYCLE and (cycle := decode(Cycle, entry.data).record).cycle in {77, 90}:
            other = Cycle(record=replace(cycle, segments=cycle.segments + 1))
            entries[i] = entry._replace(data=encode(other))
    rewrite(entries, tmp_path / "x.mcap")
    result = verify_file(tmp_path / "x.mcap")
    assert result.differences == 2
    assert result.first_difference is not None
    assert (result.first_difference.cycle, result.first_difference.field) == (77, "segments")
    assert result.first_difference.recorded == int(str(result.first_difference.replayed)) + 1


@pytest.mark.compiled
def test_a_memory_that_differs_is_named(run: Path, tmp_path: Path) -> None:
    """A keyframe holds the map, which no record of a cycle holds: one changed bit of it is a difference."""
    entries = entries_of(run)
    where = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME][2]
    frame = decode(Keyframe, entries[where].data)
    memory = perception_snapshot(frame, fresh_state(hall()).perception.snapshot())
    name = next(name for name in memory if name.endswith("memory.state"))
    changed = memory[name].copy()
    changed["sensors"]["history"]["range_m"][0, 0, 0] += 1e-9
    altered = keyframe(frame.cycle, frame.run_s, state_fields(frame), {**memory, name: changed})
    entries[where] = entries[where]._replace(data=encode(altered))
    rewrite(entries, tmp_path / "x.mcap")
    result = verify_file(tmp_path / "x.mcap")
    assert result.differences == 1
    assert result.first_difference is not None
    assert (result.first_difference.cycle, result.first_difference.field.split("[")[0]) == (
        frame.cycle,
        f"perception {name}",
    )


@pytest.mark.parametrize(
    ("recorded", "replayed", "expected"),
    [
        ({"a": 1, "b": [1, 2]}, {"a": 1, "b": [1, 2]}, None),
        ({"a": {"b": [1, 2.0]}}, {"a": {"b": [1, 2.5]}}, ("a.b.1", 2.0, 2.5)),
        ({"a": 1}, {"a": 1.0}, ("a", 1, 1.0)),
        ({"a": 0.0}, {"a": -0.0}, ("a", 0.0, -0.0)),
        ({"a": 1}, {}, ("a", 1, ABSENT)),
        ({}, {"a": 1}, ("a", ABSENT, 1)),
        ({"a": [1]}, {"a": [1, 2]}, ("a", [1], [1, 2])),
        ({"a": True}, {"a": 1}, ("a", True, 1)),
    ],
)
def test_the_first_difference_of_two_trees(recorded: object, replayed: object, expected: object) -> None:
    found = find_difference(recorded, replayed)
    assert repr(found) == repr(expected)
    assert (found is None) == (find_difference(replayed, recorded) is None)


def test_a_field_that_the_recording_version_did_not_know_is_not_compared_and_any_other_is() -> None:
    recorded: dict[str, object] = {"mode": {"why": None}, "rows": [{"a": 1}], "names": {"x": 1}}
    known = {"mode": {"why": None, "since": 0}, "rows": [{"a": 1, "b": 0}], "names": {"x": 1}}
    replayed: dict[str, object] = {"mode": {"why": None, "since": 5}, "rows": [{"a": 1, "b": 7}], "names": {"x": 1}}
    assert find_difference(recorded, without_later(replayed, recorded, known)) is None
    replayed |= {"names": {"x": 1, "y": 2}}  # no field: a name in what was decided
    found = find_difference(recorded, without_later(replayed, recorded, known))
    assert found == ("names.y", ABSENT, 2)


@pytest.mark.compiled
def test_a_recording_of_before_a_field_was_added_verifies(run: Path, tmp_path: Path) -> None:
    """As if a field of the record and one of what was received had been added since."""
    entries = entries_of(run)
    for i, entry in enumerate(entries):
        if entry.topic == CYCLE:
            content = json.loads(entry.data)
            del content["record"]["refused"], content["record"]["inputs"]["received"]["notes"]
            entries[i] = entry._replace(data=json.dumps(content).encode())
    rewrite(entries, tmp_path / "older.mcap")
    result = verify_file(tmp_path / "older.mcap")
    assert (result.first_difference, result.cycles) == (None, 20 * SECONDS)


@pytest.mark.promise("P21")
def test_no_more_gaps_are_listed_than_a_person_reads() -> None:
    """A file of 100 kB can have a million cycles, each of them after a gap."""
    result = ReplayResult()
    for cycle in range(2 * GAPS_MAX):
        result.add_gap(2 * cycle, 2 * cycle)
    assert len(result.missing) == GAPS_MAX
