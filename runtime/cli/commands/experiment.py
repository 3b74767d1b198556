"""`echolocate experiment`: the paper's experiments in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_settings
from config.settings import Settings
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, make_output_folder
from runtime.cli.tables import boxes_table, outcome_line, scene_line, spread_line, table_2
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.simulation.scene_names import SceneName
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.length_format import Units
from runtime.support.pattern_check import refuse_undrivable
from runtime.support.progress import progress

if TYPE_CHECKING:
    from runtime.simulation.evaluation import SeedOutcome

QUEUE_MAX: Final = 1_000_000
"""Items that may wait to be recorded: virtual time runs faster than any disk writes."""
SEEDS_SHOWN: Final = 2
"""With more seeds, only the summary is printed."""
ROWS_SHOWN: Final = 24
"""Longer tables are not printed."""


def run_experiment(
    name: str,
    sets: Sequence[str],
    *,
    world: str | None,
    models: Sequence[str] = (),
    seeds: int,
    out: str | None = None,
    json_file: str | None,
    force: bool,
    units: Units,
) -> int:
    """Drive through the experiment's hall once per seed, print the outcome and return the exit code.

    Parameters
    ----------
    name, sets, world, models, seeds, out, json_file, force, units
        As of `runtime.cli.experiment_commands.experiment`.

    Raises
    ------
    UserError
        The settings do not describe an experiment, or a file cannot be written.
    """
    from runtime.simulation.evaluation import run_seed, stop_at_leg_end, summarise

    settings = stop_at_leg_end(load_settings(name, sets, world=world, models=models))
    if settings.world is None or not settings.world.drum:
        raise UserError("the world has no drum: the experiment compares what is recognised with drums", WRONG_CALL)
    refuse_undrivable(settings)
    console, output = EscapingConsole(stderr=True), plain_console()
    folder = None if out is None else make_output_folder(out)
    check_outputs({"--out": [] if folder is None else run_files(folder, name), "--json": json_file}, force=force)
    prepare_kernels(settings, console)
    from runtime.cycle.summary import write_json

    outcomes = []
    with progress(console, "driving", seeds) as step:
        for seed in range(seeds):
            if seed == 0 and folder is not None:
                outcomes.append(record_seed(settings, seed, folder / f"{name}.mcap"))
            else:
                outcomes.append(run_seed(settings, settings.world, seed))
            step()
    outcome = summarise(outcomes)
    if json_file is not None:
        write_json(json_file, outcome)
    if seeds <= SEEDS_SHOWN:
        output.print(table_2(outcome, units))
    output.print(outcome_line(outcome, units))
    if "spread" in outcome:
        output.print(spread_line(outcome["spread"], units))
    if folder is not None:
        for path in draw_recorded_run(folder, name, console, units):
            output.print(str(path))
    return DONE


def run_files(folder: Path, name: str) -> list[Path]:
    """Return the files that `run_experiment` may write into `--out`: recording, page and figures."""
    from runtime.cli.commands.figures import figure_files

    return [folder / f"{name}.mcap", folder / f"{name}.html", *figure_files(folder, moving=True)]


def record_seed(settings: Settings, seed: int, path: Path) -> SeedOutcome:
    """Run the experiment with one seed, record it, and return its outcome.

    Parameters
    ----------
    settings : Settings
        Of the run, with a world.
    seed : int
        Of everything random.
    path : Path
        The recording.

    Raises
    ------
    UserError
        The run failed, or the recording could not be written completely.
    """
    from drivers.messages import Pose
    from runtime.cycle.step import CycleRecord, State
    from runtime.recording.recorder import Recorder
    from runtime.recording.storage import SingleFile
    from runtime.simulation.evaluation import run_seed

    run_s = 0.0
    with Recorder(settings, SingleFile(path), clock=lambda: run_s, queue_max=QUEUE_MAX, emulated=True) as recorder:

        def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
            nonlocal run_s
            run_s = record.inputs.run_s
            recorder.on_cycle(record, state)

        def on_bytes(direction: str, at_s: float, data: bytes) -> None:
            recorder.on_bytes(direction, at_s, at_s, data)

        if settings.world is None:
            raise UserError("there is no world to drive through", WRONG_CALL)
        outcome = run_seed(settings, settings.world, seed, on_state, on_bytes)
        recorder.on_summary(outcome.end)
    if recorder.status.last_error is not None or recorder.status.dropped:
        why = recorder.status.last_error or "the disk was too slow"
        raise UserError(f"--out: the recording is incomplete: {why}; make room or choose another place", FAILED)
    return outcome


def draw_recorded_run(folder: Path, name: str, console: Console, units: Units) -> list[Path]:
    """Write figures and page of a recorded run into its folder and return all files.

    Parameters
    ----------
    folder : Path
        Holds the recording.
    name : str
        Of the recording, without suffix.
    console : Console
        Where progress is shown.
    units : {"m", "ft"}
        Units of figures and page.
    """
    from runtime.analysis.timeline_sources import TimelineSource
    from runtime.cli.commands.figures import draw_all
    from runtime.cli.commands.report import write_page

    timeline = read_timeline(TimelineSource(str(folder / f"{name}.mcap")), console)
    page = folder / f"{name}.html"
    write_page(timeline, page, console, units=units)
    return [timeline.path, page, *draw_all(timeline, folder, console, moving=True, units=units)]


def run_scenes(
    scene: SceneName,
    sets: Sequence[str],
    *,
    models: Sequence[str],
    seeds: int,
    json_file: str | None,
    force: bool,
    units: Units,
) -> int:
    """Give perception the readings of a scene once per seed, print the outcome and return the exit code.

    Parameters
    ----------
    scene, sets, models, seeds, json_file, force, units
        As of `runtime.cli.experiment_commands.experiment`.
    """
    settings = load_settings("hallway", sets, models=models)
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": json_file}, force=force)
    prepare_kernels(settings, console)
    from runtime.cycle.summary import write_json
    from runtime.simulation.open_loop import run_scene, summarise_scene

    halls = []
    with progress(console, "driving", seeds) as step:
        for seed in range(seeds):
            halls += run_scene(settings, scene, seed)
            step()
    outcome = summarise_scene(scene, halls, settings.models)
    if json_file is not None:
        write_json(json_file, outcome)
    output = EscapingConsole()
    if len(outcome["drums"]) + len(outcome["boxes"]) <= ROWS_SHOWN:
        if outcome["drums"]:
            output.print(table_2(outcome, units))
        if outcome["boxes"]:
            output.print(boxes_table(outcome, units))
    output.print(scene_line(outcome, units), soft_wrap=True)
    return DONE
