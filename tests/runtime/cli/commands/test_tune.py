"""`echolocate tune` with a pool in this process: files, going on after a stop, and calls that it refuses."""

from __future__ import annotations

import importlib.util
import signal
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from config.errors import DONE, FAILED, WRONG_CALL
from config.study import Value, VaryConfig
from runtime.batch.dispatch import Done
from runtime.batch.runs import Run
from runtime.batch.search import Asked
from runtime.cli.app import run_command
from runtime.cli.start_signals import ending_in_order

SURE = "perception.bayes.report_probability"
STUDY = f"""
scenes = ["clean"]
seeds = 3
[[vary]]
setting = "{SURE}"
values = [0.2, 0.4, 0.6]
"""


class InTurn:
    """A search that tries the values of the first setting in turn."""

    def __init__(self, varied: Sequence[VaryConfig], present: Mapping[str, Value], seed: int) -> None:
        del present, seed
        self._varied, self._asked = varied[0], 0

    def ask(self) -> Asked:
        self._asked += 1
        values = self._varied.values
        return Asked(self._asked - 1, {self._varied.setting: values[self._asked % len(values)]})

    def tell(self, number: int, cost: float) -> None:
        pass


class Pool:
    """A pool whose runs end at once, with an f1 that a setting decides; it ends with the process after so many."""

    def __init__(self, ends_after: int = 999, broken: float | None = None) -> None:
        self.left, self.broken = ends_after, broken
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
        at = run.varied.get(SURE, 0.95)
        assert isinstance(at, float)
        if at == self.broken:
            return Done(run, attempt, MemoryError("too large"))
        return Done(run, attempt, {"key": run.key, "version": "1", "status": "done", "f1": 1.0 - abs(at - 0.4)})


Tune = Callable[..., int]


@pytest.fixture
def tune(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Tune:
    """Return a function that calls the command with a pool."""
    monkeypatch.chdir(tmp_path)
    Path("study.toml").write_text(STUDY)
    monkeypatch.setattr("runtime.cli.commands.tune.require_package", lambda *_: None)
    monkeypatch.setattr("runtime.cli.commands.sweep.prepare_kernels", lambda *_: None)
    monkeypatch.setattr("runtime.batch.search.OptunaSearch", InTurn)

    def call(pool: Pool, *words: str) -> int:
        @contextmanager
        def connected(*_: object) -> Iterator[Pool]:
            yield pool

        monkeypatch.setattr("runtime.batch.cluster.connected", connected)
        trials = () if "--trials" in words else ("--trials", "4")
        return run_command(["tune", "study.toml", *trials, *words])

    return call


def test_the_changes_and_what_they_bring_are_written(tune: Tune, capsys: pytest.CaptureFixture[str]) -> None:
    assert tune(Pool()) == DONE
    out = capsys.readouterr().out.splitlines()
    assert out[0] == f"{SURE}: 0.95 → 0.4"
    assert out[1].startswith("f1: 0.45 → 1, +0.55 ± ")
    assert out[2] == "the changes are better in what was held out (3 runs)"
    assert out[3:] == ["study-tune/tuned.toml", "study-tune/trials.csv", "study-tune/report.html"]
    assert tomllib.loads(Path(out[3]).read_text()) == {"perception": {"bayes": {"report_probability": 0.4}}}


def test_why_the_present_settings_have_no_result_is_said(tune: Tune, capsys: pytest.CaptureFixture[str]) -> None:
    assert tune(Pool(broken=0.95)) == FAILED
    assert (
        "a run with the present settings ended without a result: clean: MemoryError: too" in capsys.readouterr().err
    )


def test_a_search_that_was_stopped_makes_only_what_is_left(tune: Tune) -> None:
    stopped, second, third = Pool(7), Pool(), Pool(0)
    with ending_in_order(), pytest.raises(SystemExit):
        tune(stopped)
    assert tune(second) == DONE
    assert 999 - second.left == 3 * 4 + 2 * 3 - 7, "the present and three values by three seeds, and the held out"
    assert tune(third) == DONE, "nothing is left"


def test_what_ends_without_a_result_is_said(tune: Tune, capsys: pytest.CaptureFixture[str]) -> None:
    assert tune(Pool(broken=0.6), "--retries", "0", "--out", "x") == FAILED
    assert "MemoryError: too large; the same call tries them again" in capsys.readouterr().err
    assert "too large" in Path("x/report.html").read_text()


@pytest.mark.parametrize(
    ("vary", "words", "problem"),
    [
        ("", ("--workers", "0"), "must be at least 1"),
        ("", ("--trials", "0"), "must be at least 1"),
        ("ring.resolution_m", (), "tune it with recordings"),
        ("models.0", (), "a part of a list"),
    ],
)
def test_wrong_calls(
    tune: Tune, vary: str, words: tuple[str, ...], problem: str, capsys: pytest.CaptureFixture[str]
) -> None:
    if vary:
        Path("study.toml").write_text(STUDY + f'[[vary]]\nsetting = "{vary}"\nvalues = [1, 2]\n')
    assert tune(Pool(0), *words) == WRONG_CALL
    assert problem in capsys.readouterr().err


def test_a_sweep_refuses_a_range(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY.replace("values = [0.2, 0.4, 0.6]", "range = [0.2, 0.6]"))
    assert run_command(["sweep", str(study)]) == WRONG_CALL
    assert "`echolocate tune` searches" in capsys.readouterr().err


def test_a_missing_extra_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    find = importlib.util.find_spec
    missing = {"distributed", "optuna"}
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name in missing else find(name, *a))
    assert run_command(["tune", "halls"]) == WRONG_CALL, "its ring is that of the scenes"
    Path("study.toml").write_text(STUDY)
    assert run_command(["tune", "study.toml"]) == FAILED
    assert "pip install 'echolocate[tune]'" in capsys.readouterr().err
