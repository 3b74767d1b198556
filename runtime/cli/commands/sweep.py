"""`echolocate sweep`: the runs of a study on many workers, and what they found."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import plain_console, require_package
from runtime.cli.commands.output_files import make_output_folder, writing
from runtime.cli.options import Count
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.file_lock import file_lock
from runtime.support.kernel_cache import needed_parts
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

if TYPE_CHECKING:
    from collections.abc import Callable

    from config.study import StudyConfig
    from runtime.batch.dispatch import Unfinished
    from runtime.batch.outcome import Combination
    from runtime.batch.runs import Run

PACKAGES: Final = (("distributed", "distributed"), ("pyarrow", "pyarrow"))
EXTRA: Final = "sweep"
PAGE: Final = "report.html"
LOCK: Final = ".sweep"
"""File in the folder of a sweep: marks it as one, and is locked while one runs."""
LOG: Final = "workers.log"
LINE_PERIOD_S: Final = 60.0
"""Time between two lines of progress where there is no terminal."""
SHOWN: Final = 5
"""Combinations that are printed; the page has more."""


def sweep(
    study: str,
    /,
    *,
    out: str | None = None,
    scheduler: Annotated[str | None, Parameter(show_default=False)] = None,
    workers: Count | None = None,
    retries: Count = 3,
) -> int:
    """Make the runs of a study on many processes or machines, and compare their settings; needs the extra `sweep`.

    A sweep that was stopped, in whatever way, goes on when it is called again.

    Parameters
    ----------
    study
        Study file, or the name of a shipped one: scenes, worlds or recordings, seeds, and settings to vary.
    out
        Folder for the results: runs.parquet, report.html and a file for each run; by default NAME-sweep.
    scheduler
        Address of a Dask scheduler, as in tcp://host:8786; by default, processes of this machine do the work.
    workers
        Processes on this machine; by default one for each processor.
    retries
        How often a run that ended without a result is tried again.

    Raises
    ------
    UserError
        There are no workers, or the options exclude one another.
    """
    from config.load import load_study
    from runtime.batch.runs import expand

    processes = worker_processes(workers, scheduler)
    chosen = load_study(study)
    if (one := next((one for one in chosen.vary if one.range), None)) is not None:
        raise UserError(
            f"{study}: {one.setting} has a range, in which `echolocate tune` searches: give values for a sweep",
            WRONG_CALL,
        )
    runs = expand(chosen, Path(study).parent)
    for module, package in PACKAGES:
        require_package(module, package, EXTRA)
    folder = sweep_folder(f"{Path(study).stem}-sweep" if out is None else out)
    console = EscapingConsole(stderr=True)
    with file_lock(folder / LOCK, f"--out {folder}"), keeping_what_is_done(folder, console):
        unfinished = make_runs(runs, folder, console, scheduler=scheduler, workers=processes, retries=retries)
        combinations = write_results(Path(study).stem, chosen, runs, folder, unfinished)
    output = plain_console()
    output.print(best_table(chosen, combinations))
    for file in (folder / "runs.parquet", folder / PAGE):
        output.print(str(file))
    if unfinished:
        raise UserError(
            f"{len(unfinished)} of {len(runs)} runs ended without a result, the first: "
            f"{unfinished[0].reason}; {folder / PAGE} lists them; the same call tries them again",
            FAILED,
        )
    return DONE


def worker_processes(workers: int | None, scheduler: str | None) -> int:
    """Return how many processes of this machine work.

    Raises
    ------
    UserError
        There are none, or a scheduler has its own.
    """
    if workers == 0:
        raise UserError("--workers 0: must be at least 1", WRONG_CALL)
    if workers is not None and scheduler is not None:
        raise UserError("--scheduler has workers of its own: leave out --workers", WRONG_CALL)
    return workers or os.cpu_count() or 1


def sweep_folder(path: str) -> Path:
    """Return the folder of a sweep, a new one or that of an earlier call.

    Raises
    ------
    UserError
        It holds something else.
    """
    folder = make_output_folder(path)
    if not (folder / LOCK).exists() and any(folder.iterdir()):
        raise UserError(f"--out {path}: holds other files than a sweep's; name another folder", WRONG_CALL)
    return folder


def make_runs(
    runs: Sequence[Run], folder: Path, console: Console, *, scheduler: str | None, workers: int, retries: int
) -> list[Unfinished]:
    """Make those runs that have no row yet, and return those that were given up.

    Parameters
    ----------
    runs : sequence of Run
        All runs of the study.
    folder : Path
        Of the sweep.
    console : Console
        For progress.
    scheduler, workers, retries
        As of `sweep`.
    """
    from runtime.batch.cluster import connected
    from runtime.batch.dispatch import dispatch
    from runtime.batch.rows import RowFolder
    from runtime.batch.worker import Row

    rows = RowFolder(folder)
    finished = rows.read(runs)
    left = [run for run in runs if run.key not in finished]
    if finished:
        console.print(f"{len(finished)} of {len(runs)} runs are finished already")
    if not left:
        return []
    workers = min(workers, len(left))
    say_start(len(left), scheduler, workers, console)
    if scheduler is None:
        compile_kernels(left, console)
    pools = connected(scheduler, workers, folder / LOG, partial(console.print, soft_wrap=True))
    with pools as pool, progress(console, "running", len(left)) as step:
        lines = ProgressLines(console, len(left), time.monotonic)

        def on_row(row: Row) -> None:
            with writing("--out", folder):
                rows.write(row)
            step()
            lines.step()

        return dispatch(left, pool, on_row, retries)


def say_start(runs: int, scheduler: str | None, workers: int, console: Console) -> None:
    """Say what begins: Dask, the kernels and the processes take seconds before the first run.

    Parameters
    ----------
    runs : int
        To make, at most.
    scheduler, workers
        As of `sweep`.
    console : Console
        Gets the line.
    """
    here = f"{workers} process{'es' * (workers > 1)} of this machine"
    console.print(f"starting {runs} runs on {here if scheduler is None else scheduler}", soft_wrap=True)


@contextlib.contextmanager
def keeping_what_is_done(folder: Path, console: Console) -> Iterator[None]:
    """Say at an interrupt, at once, that the finished runs are kept; the workers may take a while to end.

    Parameters
    ----------
    folder : Path
        Where they are.
    console : Console
        Gets the line.
    """
    try:
        yield
    except SystemExit:  # of `runtime.cli.start_signals`
        text = f"interrupted: what is done is kept in {folder}; the same call goes on from there"
        console.print(text, soft_wrap=True)
        raise


def compile_kernels(runs: Sequence[Run], console: Console, prepared: set[str] | None = None) -> None:
    """Compile what the runs need once, before several processes would do so at the same time.

    Parameters
    ----------
    runs : sequence of Run
        What will be run.
    console : Console
        For progress.
    prepared : set of str, optional
        The parts that are compiled already; more are added.
    """
    from config.settings import Settings

    prepared = set() if prepared is None else prepared
    for text in {run.settings: None for run in runs}:
        settings = Settings.model_validate_json(text)
        parts = [part for part in needed_parts(settings) if part not in prepared]
        if parts:
            prepare_kernels(settings, console, parts)
            prepared.update(parts)


class ProgressLines:
    """Progress where there is no terminal: a line every minute, with the time left.

    Parameters
    ----------
    console : Console
        Where the lines go.
    total : int
        Runs to make.
    clock : callable
        Returns the time, s.
    """

    def __init__(self, console: Console, total: int, clock: Callable[[], float]) -> None:
        self._console, self._total, self._clock = console, total, clock
        self._started_s = self._said_s = clock()
        self._done = self._skipped = 0

    def skip(self, runs: int) -> None:
        """Note runs that are finished already, which took no time."""
        self._skipped += runs

    def step(self) -> None:
        """Note a run that was made."""
        self._done += 1
        now_s = self._clock()
        if self._console.is_terminal or now_s - self._said_s < LINE_PERIOD_S:
            return
        self._said_s = now_s
        done = self._done + self._skipped
        left_min = (now_s - self._started_s) / self._done * max(0, self._total - done) / 60.0
        self._console.print(f"{done} of {self._total} runs, {left_min:.0f} min left")


def write_results(
    name: str, study: StudyConfig, runs: Sequence[Run], folder: Path, unfinished: Sequence[Unfinished]
) -> list[Combination]:
    """Write table and page of all finished runs, and return what was found for each combination of settings.

    `runs`: all of the study. `folder`: that of the sweep. `unfinished`: the runs that were given up.
    """
    from runtime.batch.outcome import combine
    from runtime.batch.report import sweep_page
    from runtime.batch.rows import RowFolder, table, write_table
    from runtime.support.whole_file import whole_file

    finished = RowFolder(folder).read(runs)
    combinations = combine(runs, finished)
    with writing("--out", folder):
        write_table(study, table(study, runs, finished), folder)
        with whole_file(folder / PAGE) as part:
            part.write_text(sweep_page(name, study, len(runs), combinations, unfinished), encoding="utf-8")
    return combinations


def best_table(study: StudyConfig, combinations: Sequence[Combination]) -> Table:
    """Return the best combinations as a table for the terminal."""
    from runtime.batch.report import best_rows

    headings, rows = best_rows(study, combinations, SHOWN)
    shown = Table(title=f"the best of {len(combinations)} combinations", title_justify="left")
    for heading in headings:
        shown.add_column(heading, justify="right", overflow="fold")
    for row in rows:
        shown.add_row(*row)
    return shown
