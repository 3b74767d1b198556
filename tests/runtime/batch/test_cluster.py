"""Sweeps on real workers that are killed, and on a scheduler that is; they need Dask, so `make soak` runs them."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from config.errors import DONE, UserError
from runtime import VERSION
from runtime.batch import cluster
from runtime.batch.cluster import DaskPool
from runtime.batch.runs import Run

STUDY = """
scenes = ["clean"]
seeds = 20
models = ["drum"]
[[vary]]
setting = "ring.beam_half_angle_deg"
values = [10.0, 12.0]
"""
RUNS = 40
KILLS = 20
TIMEOUT_S = 900.0


def sweep(folder: Path, *more: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "runtime.cli", "sweep", "study.toml", "--out", "out", *more]
    with (folder / "stderr").open("ab") as stderr:
        return subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL, stderr=stderr)


def rows(folder: Path) -> int:
    return len(list((folder / "out" / "rows").glob("*.json")))


def wait_for_rows(folder: Path, count: int, process: subprocess.Popen[bytes]) -> bool:
    """Wait for so many rows; return whether the process still runs."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while rows(folder) < count and process.poll() is None:
        assert time.monotonic() < deadline_s, (folder / "stderr").read_text()
        time.sleep(0.02)
    return process.poll() is None


def workers_of(process: subprocess.Popen[bytes]) -> list[Any]:
    """Return the processes of the workers."""
    import psutil

    found = []
    for child in psutil.Process(process.pid).children():
        with suppress(psutil.NoSuchProcess):  # a zombie
            found += [child] if "worker" in child.cmdline() else []
    return found


def finish(folder: Path, *more: str) -> None:
    assert sweep(folder, *more).wait(TIMEOUT_S) == DONE, (folder / "stderr").read_text()


def check_each_run_once(folder: Path) -> None:
    import pyarrow.parquet as pq

    table = pq.read_table(folder / "out" / "runs.parquet").to_pylist()
    assert len(table) == RUNS == rows(folder)
    made = {(row["ring.beam_half_angle_deg"], row["seed"]) for row in table}
    assert made == {(angle, seed) for angle in (10.0, 12.0) for seed in range(20)}
    assert all(row["status"] == "done" and row["found"] == 6 for row in table)
    assert not list((folder / "out").rglob(".*.json.*")), "no part of a row is left"


@contextmanager
def dask(folder: Path, *command: str) -> Iterator[subprocess.Popen[bytes]]:
    with (folder / "dask").open("ab") as log:
        process = subprocess.Popen([sys.executable, "-m", "dask", *command], stdout=log, stderr=log)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@pytest.mark.soak
def test_killed_workers_lose_nothing(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    rng = random.Random(1)
    process = sweep(tmp_path, "--workers", "2")
    killed = 0
    for count in sorted(rng.sample(range(1, RUNS - 2), KILLS)):
        if wait_for_rows(tmp_path, count, process) and (workers := workers_of(process)):
            os.kill(rng.choice(workers).pid, signal.SIGKILL)
            killed += 1
    assert process.wait(TIMEOUT_S) == DONE, (tmp_path / "stderr").read_text()
    assert killed >= KILLS // 2
    check_each_run_once(tmp_path)


@pytest.mark.soak
def test_a_killed_client_goes_on_where_it_was(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    rng = random.Random(2)
    for count in sorted(rng.sample(range(RUNS - 2), KILLS)):
        process = sweep(tmp_path, "--workers", "2")
        if count:
            wait_for_rows(tmp_path, max(count, rows(tmp_path)), process)
        process.kill()
        process.wait()
    finish(tmp_path, "--workers", "2")
    check_each_run_once(tmp_path)


@pytest.mark.soak
def test_a_killed_scheduler_is_said_and_loses_nothing(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text(STUDY)
    information = tmp_path / "scheduler.json"
    options = ("--no-dashboard", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(information))
    moments = sorted(random.Random(4).sample(range(1, RUNS - 2), KILLS))
    for kill_at in (*moments, None):
        information.unlink(missing_ok=True)
        with dask(tmp_path, "scheduler", *options) as scheduler:
            deadline_s = time.monotonic() + 60.0
            while not information.exists():
                assert time.monotonic() < deadline_s, (tmp_path / "dask").read_text()
                time.sleep(0.05)
            address = json.loads(information.read_text())["address"]
            with dask(tmp_path, "worker", address, "--nworkers", "2", "--nthreads", "1", "--no-dashboard"):
                if kill_at is None:
                    finish(tmp_path, "--scheduler", address)
                    break
                process = sweep(tmp_path, "--scheduler", address)
                assert wait_for_rows(tmp_path, max(kill_at, rows(tmp_path)), process)
                scheduler.kill()
                assert process.wait(120.0) == 1
        assert "the Dask scheduler is gone" in (tmp_path / "stderr").read_text()
    check_each_run_once(tmp_path)


class FakeFuture:
    """A future of Dask that has ended."""

    def __init__(self, result: Any, *, is_cancelled: bool = False) -> None:
        self.key, self._result, self._is_cancelled = "", result, is_cancelled

    def cancelled(self) -> bool:
        return self._is_cancelled

    def result(self) -> Any:
        if isinstance(self._result, Exception):
            raise self._result
        return self._result


class FakeClient:
    """A client of Dask whose runs end at once with the results it is given."""

    def __init__(self, *results: FakeFuture) -> None:
        self.status = "running"
        self.results = list(results)
        self.keys: list[str] = []

    def nthreads(self) -> dict[str, int]:
        return {"tcp://a": 1, "tcp://b": 2}

    def submit(self, _function: Any, _run: Run, *, key: str) -> FakeFuture:
        self.keys.append(key)
        future = self.results.pop(0)
        future.key = key
        return future


class FakeCompleted(list[FakeFuture]):
    """Stands for `distributed.as_completed`."""

    add = list.append

    def __next__(self) -> FakeFuture:
        return self.pop(0)


def pool_of(*results: FakeFuture) -> tuple[DaskPool, FakeClient]:
    client = FakeClient(*results)
    pool: Any = DaskPool
    return pool(client, FakeCompleted()), client


RUN = Run("k", "scene", "clean", 0, "{}")


@pytest.mark.soak
def test_workers_that_cannot_start_are_said_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "WORKER_COMMAND", (sys.executable, "-c", "raise SystemExit('no module')"))
    began_s = time.monotonic()
    with (
        pytest.raises(UserError, match="each one ends at its start"),
        cluster.connected(None, 2, tmp_path / "log", print),
    ):
        pass
    assert time.monotonic() - began_s < 30.0
    assert "no module" in (tmp_path / "log").read_text()


@pytest.mark.parametrize("is_local", [False, True])
def test_a_scheduler_without_a_worker_is_said_long_before_the_sweep_is_given_up(*, is_local: bool) -> None:
    """There were two minutes of silence. Workers that start on a busy machine have nothing to say in their log."""

    class Living:
        def poll(self) -> None:
            return None

    class NoWorkers:
        def wait_for_workers(self, _count: int, timeout: float) -> None:
            clock[0] += timeout
            raise TimeoutError

    clock, said = [0.0], list[tuple[float, str]]()
    client: Any = NoWorkers()
    started: Any = (Living(),) if is_local else ()
    with pytest.raises(UserError, match="no worker after 120 s; start some"):
        cluster.await_worker(
            client, started, "no worker", "start some", lambda text: said.append((clock[0], text)), lambda: clock[0]
        )
    hint = "" if is_local else "; start some"
    after_s = cluster.LOCAL_QUIET_S if is_local else cluster.QUIET_S
    assert said == [(after_s, f"no worker yet, for which up to 120 s are waited{hint}")]


def test_a_pool_keeps_two_runs_a_thread_under_way() -> None:
    pool, _ = pool_of()
    assert pool.capacity() == 6


def test_the_next_run_that_ends_comes_with_its_row_or_its_error() -> None:
    error = ValueError("no")
    row = {"key": "k", "version": VERSION}
    pool, client = pool_of(FakeFuture(row), FakeFuture(error))
    pool.submit(RUN, 0)
    pool.submit(RUN, 1)
    assert client.keys == ["echolocate-k-0", "echolocate-k-1"], "an attempt is not the one that failed"
    assert pool.next_done() == (RUN, 0, row)
    assert pool.next_done() == (RUN, 1, error)


def test_a_lost_scheduler_and_another_version_end_the_sweep() -> None:
    pool, _ = pool_of(FakeFuture(RuntimeError("lost"), is_cancelled=True), FakeFuture({"key": "k", "version": "0"}))
    pool.submit(RUN, 0)
    pool.submit(RUN, 1)
    with pytest.raises(UserError, match="the Dask scheduler is gone"):
        pool.next_done()
    with pytest.raises(UserError, match="a worker has echolocate 0, and this is"):
        pool.next_done()
