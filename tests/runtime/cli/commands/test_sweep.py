"""`echolocate sweep` with a pool in this process: results, going on after a stop, and calls that it refuses."""

from __future__ import annotations

import importlib.util
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL
from runtime.batch.dispatch import Done
from runtime.batch.runs import Run
from runtime.cli.app import run_command
from runtime.cli.commands.sweep import ProgressLines
from runtime.cli.start_signals import ending_in_order
from runtime.support.file_lock import file_lock

STUDY = """
scenes = ["clean"]
seeds = 3
[[vary]]
setting = "ring.beam_half_angle_deg"
values = [8.0, 12.0]
"""


class LocalPool:
    """A pool that makes no run, but gives its recall; it ends with the process after so many runs."""

    def __init__(self, ends_after: int, broken_seed: int | None = None) -> None:
        self.left = ends_after
        self.broken_seed = broken_seed
        self.made: list[tuple[float, int | None]] = []
        self._runs: list[tuple[Run, int]] = []

    def capacity(self) -> int:
        return 1

    def submit(self, run: Run, attempt: int) -> None:
        self._runs.append((run, attempt))

    def next_done(self) -> Done:
        if self.left == 0:
            signal.raise_signal(signal.SIGINT)
        self.left -= 1
        run, attempt = self._runs.pop()
        if run.seed == self.broken_seed:
            return Done(run, attempt, MemoryError("too large"))
        angle = run.varied["ring.beam_half_angle_deg"]
        assert isinstance(angle, float)
        self.made.append((angle, run.seed))
        return Done(run, attempt, {"key": run.key, "version": "1", "status": "done", "recall": angle / 20.0})


Sweep = Callable[..., int]


@pytest.fixture
def sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Sweep:
    """Return a function that calls the command with a pool."""
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(STUDY)
    monkeypatch.setattr("runtime.cli.commands.sweep.require_package", lambda *_: None)
    monkeypatch.setattr("runtime.cli.commands.sweep.prepare_kernels", lambda *_: None)

    def call(pool: LocalPool, *words: str) -> int:
        @contextmanager
        def connected(*_: object) -> Iterator[LocalPool]:
            yield pool

        monkeypatch.setattr("runtime.batch.cluster.connected", connected)
        return run_command(["sweep", "study.toml", *words])

    return call


def test_an_interrupt_before_the_first_run_is_answered_too(
    sweep: Sweep, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Kernels and workers take seconds, in which the command has said what it starts."""
    monkeypatch.setattr("runtime.cli.commands.sweep.prepare_kernels", lambda *_: signal.raise_signal(signal.SIGINT))
    with ending_in_order(), pytest.raises(SystemExit):
        sweep(LocalPool(0))
    err = capsys.readouterr().err
    assert err.index("starting 6 runs on ") < err.index("interrupted: what is done is kept in study-sweep; ")


def test_a_sweep_that_was_stopped_makes_only_what_is_left(sweep: Sweep, capsys: pytest.CaptureFixture[str]) -> None:
    first, second, third = LocalPool(4), LocalPool(99), LocalPool(0)
    with ending_in_order(), pytest.raises(SystemExit):
        sweep(first)
    assert sweep(second) == DONE
    out, err = capsys.readouterr()
    assert "interrupted: what is done is kept in study-sweep; the same call goes on from there" in err
    assert "4 of 6 runs are finished already" in err
    assert out.splitlines()[-2:] == ["study-sweep/runs.parquet", "study-sweep/report.html"]
    assert sorted(first.made + second.made) == [(angle, seed) for angle in (8.0, 12.0) for seed in range(3)]
    table = pq.read_table("study-sweep/runs.parquet").to_pylist()
    assert sorted((row["ring.beam_half_angle_deg"], row["seed"], row["recall"]) for row in table) == [
        (angle, seed, angle / 20.0) for angle in (8.0, 12.0) for seed in range(3)
    ]
    assert sweep(third) == DONE, "nothing is left"
    assert out.index("12.0") < out.index("8.0"), "the best first"


def test_what_ends_without_a_result_is_listed_and_tried_again(
    sweep: Sweep, capsys: pytest.CaptureFixture[str]
) -> None:
    assert sweep(LocalPool(99, broken_seed=1), "--retries", "1", "--out", "x") == FAILED
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("echolocate: ")]
    assert "2 of 6 runs ended without a result, the first: MemoryError: too large" in line
    assert "too large" in Path("x/report.html").read_text()
    assert sweep(LocalPool(2), "--out", "x") == DONE


def test_a_folder_of_something_else_is_refused(sweep: Sweep, capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine").mkdir()
    Path("mine/runs.parquet").write_text("mine")
    assert sweep(LocalPool(99), "--out", "mine") == WRONG_CALL
    assert "holds other files than a sweep's" in capsys.readouterr().err
    assert Path("mine/runs.parquet").read_text() == "mine"
    Path("twice").mkdir()
    with file_lock(Path("twice/.sweep"), "x"):
        assert sweep(LocalPool(99), "--out", "twice") == FAILED
    assert "another process writes" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "problem"),
    [(("--workers", "0"), "must be at least 1"), (("--workers", "2", "--scheduler", "tcp://a:1"), "leave out")],
)
def test_wrong_calls(sweep: Sweep, words: tuple[str, ...], problem: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert sweep(LocalPool(0), *words) == WRONG_CALL
    assert problem in capsys.readouterr().err


def test_a_missing_extra_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name == "distributed" else find(name, *a)
    )
    assert run_command(["sweep", "halls"]) == FAILED
    assert "pip install 'echolocate[sweep]'" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_without_a_terminal_there_is_a_line_a_minute(capsys: pytest.CaptureFixture[str]) -> None:
    times = iter([0.0, 30.0, 70.0, 90.0, 131.0])
    lines = ProgressLines(Console(force_terminal=False), 12, lambda: next(times))
    lines.skip(2)
    for _ in range(4):
        lines.step()
    assert capsys.readouterr().out.splitlines() == ["4 of 12 runs, 5 min left", "6 of 12 runs, 3 min left"]
