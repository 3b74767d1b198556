"""`echolocate tune`: better settings for a user's own recordings or scenes, as a TOML file with the differences."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_study, override_settings
from config.settings import Settings
from config.study import StudyConfig, Value, VaryConfig
from runtime.cli.commands.offline_io import plain_console, require_package
from runtime.cli.commands.output_files import writing
from runtime.cli.commands.sweep import (
    LOCK,
    LOG,
    PAGE,
    ProgressLines,
    compile_kernels,
    keeping_what_is_done,
    sweep_folder,
)  # fmt: skip
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.file_lock import file_lock
from runtime.support.progress import progress

if TYPE_CHECKING:
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
THRESHOLDS: Final = tuple(
    VaryConfig(setting=f"perception.bayes.{name}", values=(0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999))
    for name in ("report_probability", "report_probability_near")
)
"""Searched where the truth is known and a study names no settings. Without a truth no threshold can be found: what a
false object costs is for the user to say."""
SENSORS: Final = (
    VaryConfig(setting="ring.beam_half_angle_deg", range=(4.0, 40.0), log=True),
    VaryConfig(setting="ring.resolution_m", range=(0.001, 0.3), log=True),
)
"""What recordings show of the sensors, searched where a study names no settings."""


def run_tune(
    name: str, *, out: str | None, trials: int, scheduler: str | None, workers: int, retries: int, seed: int = SEED
) -> int:
    """Search among the settings of a study, write what is better, and return the exit code.

    Parameters
    ----------
    name, out, trials, scheduler, workers, retries
        As of `runtime.cli.experiment_commands.tune`.
    seed : int
        Of the search.

    Raises
    ------
    UserError
        The study is invalid, a package is missing, the folder is not a search's, or a run was given up.
    """
    study, base = tuned_study(name)
    for module, package in PACKAGES:
        require_package(module, package, EXTRA)
    from runtime.batch.search import OptunaSearch
    from runtime.batch.tuning import Tuner, trial_runs

    present = present_values(study, base)
    folder = sweep_folder(f"{Path(name).stem}-tune" if out is None else out)
    console = EscapingConsole(stderr=True)
    unfinished: list[Unfinished] = []

    searched = trial_runs(study, base, [{}], held_out=False)
    held_out = trial_runs(study, base, [{}], held_out=True)
    total = len(searched) * (1 + trials + len(study.vary)) + 2 * len(held_out)
    if scheduler is None:
        compile_kernels(searched, console)
    with (
        file_lock(folder / LOCK, f"--out {folder}"),
        run_maker(folder, console, total, unfinished, scheduler=scheduler, workers=workers, retries=retries) as make,
    ):
        tuned = Tuner(study, base, make).search(OptunaSearch(study.vary, present, seed), trials)
        write_results(Path(name).stem, study, present, tuned, folder, unfinished)
    say_results(tuned, present, folder)
    if unfinished:
        raise UserError(f"{len(unfinished)} runs ended without a result, the first: {unfinished[0].reason}; the same "
                        "call tries them again", FAILED)  # fmt: skip
    return DONE


def tuned_study(name: str) -> tuple[StudyConfig, Path]:
    """Return the study of a name, a file, or a folder of recordings, and the folder that its paths refer to.

    Settings to search among and objectives that the study leaves out are added.

    Raises
    ------
    UserError
        It is invalid, or cannot be tuned.
    """
    if Path(name).is_dir():
        study, base = StudyConfig(recordings="."), Path(name)
    else:
        study, base = load_study(name), Path(name).parent
    of_recordings = study.recordings is not None
    is_true = not of_recordings or study.truth is not None
    if "objectives" not in study.model_fields_set:
        study = study.model_copy(update={"objectives": ("f1", "mean_error_m") if is_true else ("predicted_nat",)})
    if not study.vary:
        judged = "predicted_nat" not in study.objectives
        vary = (*(SENSORS if of_recordings else ()), *(THRESHOLDS if judged else ()))
        study = study.model_copy(update={"vary": vary})
    for one in study.vary:
        if not of_recordings and one.setting.split(".")[0] in ("ring", "body", "robot", "world"):
            raise UserError(f"{name}: {one.setting}: scenes and worlds would be sensed by another robot then, not "
                            "better by this one: tune it with recordings, or compare robots with a sweep",
                            WRONG_CALL)  # fmt: skip
        if any(part.isdigit() for part in one.setting.split(".")):
            raise UserError(f"{name}: {one.setting}: a part of a list cannot be tuned: compare values with a sweep",
                            WRONG_CALL)  # fmt: skip
    return study, base


def present_values(study: StudyConfig, base: Path) -> dict[str, Value]:
    """Return the present value of each varied setting, where it has one; of the first recording if there are any."""
    from runtime.batch.runs import expand
    from runtime.recording.reader import is_recording, open_recording

    first = expand(study, base, [{}])[0]
    settings, path = Settings.model_validate_json(first.settings), Path(first.subject)
    if first.kind == "recording" and is_recording(path):
        with open_recording(path) as recording:
            settings = override_settings(recording.settings, str(path), study.sets)
    table, found = settings.model_dump(mode="json"), dict[str, Value]()
    for one in study.vary:
        value: object = table
        for part in one.setting.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if isinstance(value, bool | int | float | str):
            found[one.setting] = value
    return found


@contextmanager
def run_maker(
    folder: Path, console: Console, total: int, unfinished: list[Unfinished], *,
    scheduler: str | None, workers: int, retries: int,
) -> Iterator[Make]:  # fmt: skip
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
    with (
        keeping_what_is_done(folder, console),
        connected(scheduler, workers, folder / LOG) as pool,
        progress(console, "tuning", total) as step,
    ):
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
    name: str, study: StudyConfig, present: Mapping[str, Value], tuned: Tuned, folder: Path,
    unfinished: Sequence[Unfinished],
) -> None:  # fmt: skip
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
    from runtime.batch.tuning_report import changes_text, page, trials_text
    from runtime.support.whole_file import whole_file

    texts = {PAGE: page(name, study, present, tuned, unfinished), TRIALS: trials_text(study, tuned)}
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
