"""Sweeps: how they scale on a machine, what a scheduler of many workers costs, how fast recordings are replayed."""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

from rich.table import Table

from config.errors import UserError
from config.settings import Settings
from config.study import StudyConfig
from runtime import VERSION
from runtime.batch.dispatch import dispatch
from runtime.batch.runs import Run, expand
from runtime.batch.worker import Row, run_one
from runtime.recording.extent import recording_extent
from runtime.recording.reader import is_recording
from runtime.recording.ring_log import read_ring_log

TIMEOUT_S: Final = 60.0
BARE: Final = (
    ("distributed.worker.profile.enabled", False),
    ("distributed.admin.system-monitor.interval", "60s"),
    ("distributed.admin.system-monitor.disk", False),
    ("distributed.admin.system-monitor.gil.enabled", False),
)
"""Settings of workers that share a process: a profiler of each would sample the threads of all a hundred."""
STUDY: Final = 'scenes = ["halls"]\nseeds = {runs}\nmodels = ["drum"]\n'
Rows = list[dict[str, float]]


def measure_scaling(runs: int, workers: Sequence[int], rounds: int, report: Callable[[str], None]) -> Rows:
    """Return how long a sweep takes with each number of workers, in turns.

    Parameters
    ----------
    runs : int
        Runs of the sweep: a hall each.
    workers : sequence of int
        Numbers of workers.
    rounds : int
        Sweeps with each.
    report : callable
        Called with what is being done.
    """
    rows: Rows = []
    for i in range(rounds):
        for count in workers:
            report(f"round {i + 1} of {rounds}, {count} workers")
            with tempfile.TemporaryDirectory() as folder:
                (Path(folder) / "study.toml").write_text(STUDY.format(runs=runs), encoding="utf-8")
                command = [sys.executable, "-m", "runtime.cli", "sweep", "study.toml", "--workers", str(count)]
                begin_s = time.monotonic()
                subprocess.run(command, cwd=folder, check=True, capture_output=True)
                whole_s = time.monotonic() - begin_s
                made = sorted(path.stat().st_mtime for path in (Path(folder) / "study-sweep" / "rows").iterdir())
            rows.append({"workers": count, "runs": len(made), "whole_s": whole_s, "between_s": made[-1] - made[0]})
    return rows


def scaling_table(rows: Rows) -> Table:
    """Return the table: whole calls, also over those of the first number of workers, and first run to last."""
    table = Table(title="A sweep with some workers, over the same with the first number of them")
    for heading in ("workers", "runs", "whole call, s", "first to last run, s", "runs an hour", "times the first"):
        table.add_column(heading, justify="right")
    first = [row for row in rows if row["workers"] == rows[0]["workers"]]
    base_s = sum(row["whole_s"] for row in first) / len(first)
    for row in rows:
        table.add_row(
            f"{row['workers']}", f"{row['runs']}", f"{row['whole_s']:.1f}", f"{row['between_s']:.1f}",
            f"{3600.0 * (row['runs'] - 1) / row['between_s']:,.0f}", f"{base_s / row['whole_s']:.2f}",
        )  # fmt: skip
    return table


def idle_run(run: Run, *, seconds: float) -> Row:
    """Return the row of a run that took so long and used no processor."""
    time.sleep(seconds)
    return {"key": run.key, "version": VERSION, "status": "done", "reason": None, "recall": 1.0, "elapsed_s": seconds}


def measure_scheduler(workers: int, runs: int, seconds: float) -> dict[str, float]:
    """Return what Dask's scheduler, in a process of its own, costs beside so many workers in this one.

    Parameters
    ----------
    workers : int
        Each makes runs in which it waits.
    runs : int
        Runs of all.
    seconds : float
        Time of one, s.
    """
    import dask
    import psutil
    from distributed import Client, as_completed

    from runtime.batch.cluster import DaskPool

    study = StudyConfig(scenes=("clean",), seeds=runs)
    todo = expand(study, Path())
    with (
        dask.config.set(dict(BARE)),
        started_scheduler() as (process, address),
        Client(address, timeout=TIMEOUT_S) as client,
    ):
        added = client.sync(_workers, address, workers)
        client.wait_for_workers(workers, timeout=TIMEOUT_S)
        pool = DaskPool(client, as_completed(), partial(idle_run, seconds=seconds))
        done: list[Row] = []
        scheduler, own = psutil.Process(process.pid), psutil.Process()
        began_s, used_s, own_s = time.monotonic(), _processor_s(scheduler), _processor_s(own)
        unfinished = dispatch(todo, pool, done.append, retries=0)
        took_s = time.monotonic() - began_s
        figures = {
            "workers": workers,
            "runs": len(done),
            "unfinished": len(unfinished),
            "run_s": seconds,
            "took_s": took_s,
            "least_s": seconds * runs / workers,
            "scheduler_share": (_processor_s(scheduler) - used_s) / took_s,
            "scheduler_ms_a_run": 1e3 * (_processor_s(scheduler) - used_s) / runs,
            "others_share": (_processor_s(own) - own_s) / took_s,
        }
        client.sync(_close, added)
    return figures


@contextmanager
def started_scheduler() -> Iterator[tuple[subprocess.Popen[bytes], str]]:
    """Yield a scheduler's process and its address."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scheduler.json"
        options = ("--no-dashboard", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file))
        command = [sys.executable, "-m", "dask", "scheduler", *options]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            try:
                deadline_s = time.monotonic() + TIMEOUT_S
                while not file.exists() or not file.stat().st_size:
                    if time.monotonic() > deadline_s or process.poll() is not None:
                        raise TimeoutError("the scheduler has not started")
                    time.sleep(0.05)
                yield process, json.loads(file.read_text(encoding="utf-8"))["address"]
            finally:
                process.kill()


async def _workers(address: str, count: int) -> list[Any]:
    """Return workers of one thread each that live in this process."""
    from distributed import Worker

    workers = [
        Worker(address, nthreads=1, memory_limit=0, dashboard=False, silence_logs="CRITICAL") for _ in range(count)
    ]
    await asyncio.gather(*(worker.start() for worker in workers))
    return workers


async def _close(workers: list[Any]) -> None:
    await asyncio.gather(*(worker.close() for worker in workers))


def _processor_s(process: Any) -> float:  # psutil has no types
    times = process.cpu_times()
    return float(times.user + times.system)


def scheduler_table(figures: dict[str, float]) -> Table:
    """Return the table."""
    table = Table(title="Dask's scheduler beside workers that only wait")
    for heading in ("figure", "value"):
        table.add_column(heading, justify="left" if heading == "figure" else "right")
    for name, value in figures.items():
        table.add_row(name, f"{value:.4g}")
    return table


def measure_replay(files: Sequence[Path], settings: Settings) -> Rows:
    """Return for each recording its length, size, and the processor time of a replay as a sweep makes it.

    Parameters
    ----------
    files : sequence of Path
        Recordings (MCAP) or ring logs.
    settings : Settings
        Of the ring logs.
    """
    rows: Rows = []
    for path in files:
        run = Run("", "recording", str(path), None, settings.model_dump_json())
        run_one(run)  # kernels are loaded
        began_s = time.process_time()
        run_one(run)
        used_s = time.process_time() - began_s
        rows.append({"recorded_s": recorded_s(path), "mb": path.stat().st_size / 1e6, "processor_s": used_s})
    return rows


def recorded_s(path: Path) -> float:
    """Return the length of a recording or ring log, s.

    Raises
    ------
    UserError
        A recording does not say.
    """
    if not is_recording(path):
        times = [firing.robot_s for firing in read_ring_log(path)]
        return times[-1] - times[0]
    duration_s = recording_extent(path).duration_s
    if duration_s is None:
        raise UserError(f"{path}: its length is not known: `echolocate recover` may help")
    return duration_s


def record_drive(folder: Path) -> list[Path]:
    """Drive through the hallway in virtual time; return its recording and the same as a ring log."""
    for words in (
        ["experiment", "hallway", "--out", "drive"],
        ["export", "drive/hallway.mcap", "--to", "ringlog", "--out", "drive.csv"],
    ):
        command = [sys.executable, "-m", "runtime.cli", *words]
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return [folder / "drive" / "hallway.mcap", folder / "drive.csv"]


def replay_table(rows: Rows) -> Table:
    """Return the table, with the machine hours of ten thousand recorded hours on one processor."""
    table = Table(title="Replays, on one processor")
    headings = ("recorded, s", "MB an hour", "replayed, s of processor time", "times real time", "10,000 h take, h")
    for heading in headings:
        table.add_column(heading, justify="right")
    for row in rows:
        speed = row["recorded_s"] / row["processor_s"]
        table.add_row(
            f"{row['recorded_s']:.0f}", f"{3600.0 * row['mb'] / row['recorded_s']:.1f}", f"{row['processor_s']:.2f}",
            f"{speed:.0f}", f"{1e4 / speed:,.0f}",
        )  # fmt: skip
    return table
