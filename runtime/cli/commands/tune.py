"""`echolocate tune`: better settings for a user's own recordings or scenes, as a TOML file with the differences."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter
from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import plain_console, require_package
from runtime.cli.commands.output_files import writing
from runtime.cli.commands.sweep import (
    LOCK,
    LOG,
    PAGE,
    ProgressLines,
    compile_kernels,
    keeping_what_is_done,
    say_start,
    sweep_folder,
    worker_processes,
)
from runtime.cli.options import Count
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.file_lock import file_lock
from runtime.support.progress import progress

if TYPE_CHECKING:
    from config.study import StudyConfig, Value
    from runtime.batch.dispatch import Unfinished
    from runtime.batch.runs import Run
    from runtime.batch.tuning import Make, Tuned
    from runtime.batch.worker import Row

PACKAGES: Final = (("distributed", "distributed"), ("optuna", "optuna"))
EXTRA: Final = "tune"
SEED: Final = 1
"""Of the search."""
CHANGES: Final = "tuned.toml"
TRIALS: Final = "trials.csv"


def tune(
    study: str,
    /,
    *,
    out: str | None = None,
    trials: Count = 60,
    scheduler: Annotated[str | None, Parameter(show_default=False)] = None,
    workers: Count | None = None,
    retries: Count = 3,
) -> int:
    """Find better settings for your recordings or scenes, and write the changes as TOML; needs the extra `tune`.

    What is gained is measured on recordings or seeds that the search has not used. A search that was stopped, in
    whatever way, goes on when it is called again.

    Parameters
    ----------
    study
        Study file, or a folder of recordings.
    out
        Folder for the results: tuned.toml, report.html, trials.csv and a file for each run; by default NAME-tune.
    trials
        Combinations of settings to try.
    scheduler
        Address of a Dask scheduler, as in tcp://host:8786; by default, processes of this machine do the work.
    workers
        Processes on this machine; by default one for each processor.
    retries
        How often a run that ended without a result is tried again.

    Raises
    ------
    UserError
        There are no workers or trials, or the options exclude one another.
    """
    from runtime.batch.search import OptunaSearch
    from runtime.batch.tuning import Tuner, trial_runs
    from runtime.batch.tuning_study import present_values, study_to_tune

    if trials == 0:
        raise UserError("--trials 0: must be at least 1", WRONG_CALL)
    processes = worker_processes(workers, scheduler)
    chosen, base = study_to_tune(study)
    for module, package in PACKAGES:
        require_package(module, package, EXTRA)
    present = present_values(chosen, base)
    name = Path(study).stem
    folder = sweep_folder(f"{name}-tune" if out is None else out)
    console = EscapingConsole(stderr=True)
    unfinished: list[Unfinished] = []

    searched = trial_runs(chosen, base, [{}], held_out=False)
    held_out = trial_runs(chosen, base, [{}], held_out=True)
    total = len(searched) * (1 + trials + len(chosen.vary)) + 2 * len(held_out)
    with (
        file_lock(folder / LOCK, f"--out {folder}"),
        keeping_what_is_done(folder, console),
        run_maker(
            folder, console, total, unfinished, scheduler=scheduler, workers=processes, retries=retries
        ) as make,
    ):
        try:
            tuned = Tuner(chosen, base, make).search(OptunaSearch(chosen.vary, present, SEED), trials)
        except UserError as error:
            if not unfinished:
                raise
            lost = unfinished[0]
            raise UserError(f"{error}: {lost.run.subject}: {lost.reason}", error.exit_code) from error
        write_results(name, chosen, present, tuned, folder, unfinished)
    say_results(tuned, present, folder)
    if unfinished:
        raise UserError(
            f"{len(unfinished)} runs ended without a result, the first: {unfinished[0].reason}; the same "
            "call tries them again",
            FAILED,
        )
    return DONE


@contextmanager
def run_maker(
    folder: Path,
    console: Console,
    total: int,
    unfinished: list[Unfinished],
    *,
    scheduler: str | None,
    workers: int,
    retries: int,
) -> Iterator[Make]:
    """Yield the function that makes runs on workers, and keeps them in a folder.

    Parameters
    ----------
    folder : Path
        Of the search.
    console : Console
        For progress.
    total : int
        Runs of the whole search.
    unfinished : list of Unfinished
        Gets those that were given up.
    scheduler, workers, retries
        As of `run_tune`.
    """
    from runtime.batch.cluster import connected
    from runtime.batch.dispatch import dispatch
    from runtime.batch.rows import RowFolder

    rows, prepared = RowFolder(folder), set[str]()
    say_start(total, scheduler, workers, console)
    pools = connected(scheduler, workers, folder / LOG, partial(console.print, soft_wrap=True))
    with pools as pool, progress(console, "tuning", total) as step:
        lines = ProgressLines(console, total, time.monotonic)

        def make(runs: Sequence[Run]) -> dict[str, Row]:
            finished = rows.read(runs)
            left = [run for run in {run.key: run for run in runs}.values() if run.key not in finished]
            lines.skip(len(runs) - len(left))
            for _ in range(len(runs) - len(left)):
                step()
            if scheduler is None:
                compile_kernels(left, console, prepared)  # a trial may recognise by the other method

            def on_row(row: Row) -> None:
                with writing("--out", folder):
                    rows.write(row)
                finished[row["key"]] = row
                step()
                lines.step()

            unfinished.extend(dispatch(left, pool, on_row, retries))
            return finished

        yield make


def write_results(
    name: str,
    study: StudyConfig,
    present: Mapping[str, Value],
    tuned: Tuned,
    folder: Path,
    unfinished: Sequence[Unfinished],
) -> None:
    """Write the changes, the trials and the page.

    Parameters
    ----------
    name : str
        Of the study.
    study : StudyConfig
        The study.
    present : mapping
        The present values.
    tuned : Tuned
        What was found.
    folder : Path
        Of the search.
    unfinished : sequence of Unfinished
        Runs that were given up.
    """
    from runtime.batch.tuning_report import changes_text, trials_text, tuning_page
    from runtime.support.whole_file import whole_file

    texts = {PAGE: tuning_page(name, study, present, tuned, unfinished), TRIALS: trials_text(study, tuned)}
    if tuned.best.values:
        texts[CHANGES] = changes_text(name, study, tuned)
    else:
        (folder / CHANGES).unlink(missing_ok=True)
    with writing("--out", folder):
        for file, text in texts.items():
            with whole_file(folder / file) as part:
                part.write_text(text, encoding="utf-8")


def say_results(tuned: Tuned, present: Mapping[str, Value], folder: Path) -> None:
    """Print what is to be changed, what it brings, and the files."""
    from runtime.batch.tuning_report import change_lines, gain_lines, judgement

    output: Callable[[str], None] = plain_console().print
    for line in (*change_lines(tuned, present), *gain_lines(tuned), judgement(tuned)):
        output(line)
    for file in (CHANGES, TRIALS, PAGE):
        if (folder / file).exists():
            output(str(folder / file))
