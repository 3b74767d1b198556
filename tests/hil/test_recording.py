"""Recordings of real runs over a pty: replayed to the bit, and restored after the run was killed at any moment."""

from __future__ import annotations

import itertools
import json
import logging
import random
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE
from runtime.cli.app import run_command
from runtime.recording.channels import CYCLE, KEYFRAME, decode
from runtime.recording.reader import open_recording
from runtime.recording.schema import Cycle, RunInfo
from tests.hil.machine import stalls_excused
from tests.hil.running import PATIENT, running, wait_for
from tests.recorded import entries_of

pytestmark = [pytest.mark.realtime, pytest.mark.usefixtures("warm_kernels")]

LOST_MAX_S = 1.0
TIGHT = ("--set", "cycle.perception_budget_s=0.0006")
"""So little that refinement is sometimes cut short, also on a fast machine."""
HOUR_MB = 30.0
RECORDED_BYTES = 40_000


def record(folder: Path, seconds: float, *more: str) -> dict[str, Any]:
    """Record a run of the six-drum hall and return its summary."""
    path = folder / "summary.json"
    command = ["run", "--seconds", str(seconds), "--json", str(path), "--force", *TIGHT, *more]
    with running(folder, "run", *command, "--record", str(folder / "hall.mcap")) as run:
        assert run.process.wait(seconds + 60.0) == 0, run.err
    got: dict[str, Any] = json.loads(path.read_bytes())
    return got


def verify(path: Path, *more: str) -> dict[str, Any]:
    """Replay a recording, fail where anything differs, and return the summary."""
    summary = path.with_suffix(".json")
    assert run_command(["replay", str(path), "--verify", "--json", str(summary), "--force", *more]) == DONE
    got: dict[str, Any] = json.loads(summary.read_bytes())
    assert got["verify"]["differences"] == 0
    return got


def keyframe_times(path: Path) -> list[float]:
    """Return when the keyframes were taken, in seconds after the first cycle."""
    entries = entries_of(path)
    first = next(entry.log_ns for entry in entries if entry.topic == CYCLE)
    return [1e-9 * (entry.log_ns - first) for entry in entries if entry.topic == KEYFRAME]


def check(folder: Path, seconds: float, replays: int, *more: str) -> str:
    """Record a run and replay it whole and from some of its keyframes; return the figures."""
    summary = record(folder, seconds, *more)
    kept = summary["recording"]
    assert (kept["dropped"], kept["last_error"], kept["files"]) == (0, None, 1)
    path = folder / "hall.mcap"
    assert kept["bytes"] == path.stat().st_size
    result = verify(path)
    assert result["cycles"] == summary["cycles"]
    assert result["objects"] == summary["objects"], "what was seen at the end, to the bit"
    frames = keyframe_times(path)
    assert result["verify"]["keyframes"] == len(frames) >= replays
    for at_s in random.Random(1).sample(frames, replays):
        part = verify(path, "--from", str(at_s + 1e-6))
        assert part["cycles"] >= summary["cycles"] - 20.0 * at_s - summary["missed"] - 10
        assert part["objects"] == summary["objects"]
    if seconds > 60.0:
        assert set(result["verify"]["refinement"]) >= {"budget", "converged", "nothing"}
        assert result["cycles"] >= 12_000
        assert result["verify"]["times_real_time"] >= 30.0
        assert hour_mb(path.stat().st_size, seconds) <= HOUR_MB
    logging.getLogger(__name__).info("%s", {**result["verify"], "bytes": kept["bytes"], "lag": summary["lag_us"]})
    causes = ", ".join(f"{count} {cause}" for cause, count in sorted(result["verify"]["refinement"].items()))
    return (
        f"{result['cycles']:,} cycles over the pty replayed, and from {replays} keyframes: 0 differences; refinement "
        f"ended by {causes}; {result['verify']['times_real_time']:.0f} × real time, "
        f"{hour_mb(kept['bytes'], seconds):.1f} MB an hour"
    )


def hour_mb(size: int, seconds: float) -> float:
    return size / seconds * 3600.0 / 1e6


def killed(folder: Path, name: str, after_s: float) -> tuple[Path, float]:
    """Kill a recorded run some time after its first cycle; return the file, and when it was killed, in Unix time."""
    path = folder / "hall.mcap"
    with running(folder, name, "run", "--record", str(path), "--force", *TIGHT) as run:
        run.comes_to("DRIVE")
        time.sleep(after_s)
        run.process.kill()
        killed_s = time.time()
        run.process.wait()
    return path, killed_s


def check_killed(folder: Path, name: str, after_s: float) -> float:
    """Kill a run, restore its recording, replay it; return how much was lost, s."""
    path, killed_s = killed(folder, name, after_s)
    restored = path.with_name(f"{path.stem}-recovered.mcap")
    assert run_command(["recover", str(path), "--force"]) == DONE
    got = verify(restored)
    cycles = [entry for entry in entries_of(restored) if entry.topic == CYCLE]
    assert got["cycles"] == len(cycles)
    assert got["verify"]["missing"] == []
    assert got["verify"]["damage"] == []
    return killed_s - 1e-9 * cycles[-1].log_ns


def lost_in(folder: Path, kills: int, seed: int, lost_max_s: float) -> list[float]:
    """Kill so many runs at random moments; return how much each lost, s, none of it more than is allowed.

    All record into one file: each takes over that of the one before, whose lock has died with it.
    """
    rng, lost, names = random.Random(seed), list[float](), itertools.count()

    @stalls_excused
    def one() -> None:
        lost_s = check_killed(folder, f"run{next(names)}", rng.uniform(1.0, 5.0))
        assert lost_s <= lost_max_s
        lost.append(lost_s)

    for _ in range(kills):
        one()
    return lost


def size_of(folder: Path) -> int:
    """Return how many bytes the files of a folder have."""
    return sum(path.stat().st_size for path in folder.glob("*"))


def test_a_killed_run_is_restored(tmp_path: Path) -> None:
    """Without an option a run records into the folder of recordings. The long form measures what a kill costs."""
    runs = tmp_path / "runs"
    where = ("--set", f"recording.folder={json.dumps(str(runs))}", "--set", "recording.keyframe_period_s=1.0")
    with running(tmp_path, "run", "run", *where, *TIGHT, *PATIENT) as run:
        wait_for(lambda: bool(run.modes()), "a first cycle")  # on a busy machine much is recorded before it
        before = size_of(runs)
        wait_for(lambda: size_of(runs) > before + RECORDED_BYTES, "a recording")
        assert run.process.poll() is None
        run.process.kill()
        run.process.wait()
    (path,) = runs.glob("*.mcap")
    restored = path.with_name(f"{path.stem}-recovered.mcap")
    assert run_command(["recover", str(path)]) == DONE
    got = verify(restored)
    entries = entries_of(restored)
    cycles = [decode(Cycle, entry.data).record.cycle for entry in entries if entry.topic == CYCLE]
    assert cycles == list(range(1, len(cycles) + 1))
    assert got["cycles"] == len(cycles) > 0
    assert (got["verify"]["missing"], got["verify"]["damage"]) == ([], [])
    with open_recording(restored) as recording:
        assert isinstance(recording.info, RunInfo)
    # A replay that begins at the last keyframe with a cycle after it ends in the same state, to the bit.
    frames = [i for i, entry in enumerate(entries) if entry.topic == KEYFRAME]
    after = [sum(entry.topic == CYCLE for entry in entries[i:]) for i in frames]
    last = max(k for k, count in enumerate(after) if count)
    part = verify(restored, "--from", str(keyframe_times(restored)[last] + 1e-6))
    assert part["cycles"] == after[last]
    assert part["objects"] == got["objects"]


@pytest.mark.soak
@stalls_excused
def test_ten_minutes_are_replayed_to_the_bit(tmp_path: Path, measured: Callable[[str], None]) -> None:
    measured(check(tmp_path, 605.0, 10))


@pytest.mark.soak
@pytest.mark.promise("P13")
def test_five_hundred_killed_runs_are_restored(tmp_path: Path, measured: Callable[[str], None]) -> None:
    lost = lost_in(tmp_path, 500, seed=100, lost_max_s=LOST_MAX_S)
    measured(
        f"{len(lost)} runs killed at random moments, each recording into the file of the one before: all restored "
        f"and replayed without a difference, at most {max(lost):.2f} s lost (mean {sum(lost) / len(lost):.2f} s)"
    )
