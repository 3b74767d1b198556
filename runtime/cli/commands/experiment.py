"""`echolocate experiment`: the paper's experiments in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.console import Console
from rich.progress import track

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_settings
from config.settings import Settings
from runtime.cli.commands.firing_check import refuse_impossible_firing
from runtime.cli.commands.offline_io import folder, read
from runtime.cli.tables import boxes_table, outcome_line, scene_line, spread_line, table_2
from runtime.simulation.scene_names import SceneName
from runtime.support.kernel_cache import prepare_kernels
from runtime.support.length_format import Units

if TYPE_CHECKING:
    from runtime.simulation.evaluation import SeedOutcome

QUEUE_MAX: Final = 1_000_000
"""Virtual time waits for no disk: everything may wait in memory."""
SEEDS_SHOWN = 2
ROWS_SHOWN = 24
"""Tables of more runs or rows than this say nothing to a person."""


def run_experiment(
    name: str,
    sets: Sequence[str],
    *,
    world: str | None,
    models: Sequence[str] = (),
    seeds: int,
    out: str | None = None,
    json_file: str | None,
    units: Units,
) -> int:
    """Carry out the command; see `runtime.cli.app.experiment`."""
    _refuse_no_seeds(seeds)
    settings = one_way(load_settings(name, sets, world=world, models=models))
    if settings.world is None or not settings.world.drum:
        raise UserError("the world holds no drum: the experiment sets drums seen against drums there", WRONG_CALL)
    refuse_impossible_firing(settings)
    console = Console(stderr=True)
    prepare_kernels(settings, console)
    from runtime.cycle.summary import write_json
    from runtime.simulation.evaluation import run_seed, summarise

    place = None if out is None else folder(out)
    told = Console(soft_wrap=True, highlight=False)
    runs = track(range(seeds), "driving", console=console, transient=True, disable=not console.is_terminal)
    outcomes = []
    for seed in runs:
        if seed == 0 and place is not None:
            outcomes.append(recorded(settings, seed, place / f"{name}.mcap"))
        else:
            outcomes.append(run_seed(settings, settings.world, seed))
    outcome = summarise(outcomes)
    if json_file is not None:
        write_json(json_file, outcome)
    if seeds <= SEEDS_SHOWN:
        told.print(table_2(outcome, units))
    told.print(outcome_line(outcome, units))
    if "spread" in outcome:
        told.print(spread_line(outcome["spread"], units))
    if place is not None:
        for path in shown(place, name, console, units):
            told.print(str(path))
    return DONE


def recorded(settings: Settings, seed: int, path: Path) -> SeedOutcome:
    """Run the experiment once and record it.

    Raises
    ------
    UserError
        As `run_seed`, or the file cannot be written.
    """
    from drivers.messages import Pose
    from runtime.cycle.step import CycleRecord, State
    from runtime.recording.recorder import Recorder
    from runtime.recording.storage import SingleFile
    from runtime.simulation.evaluation import run_seed

    now = [0.0]
    with Recorder(settings, SingleFile(path), clock=lambda: now[0], queue_max=QUEUE_MAX, emulated=True) as recorder:

        def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
            now[0] = record.inputs.run_s
            recorder.on_cycle(record, state)

        if settings.world is None:
            raise UserError("there is no world to drive through", WRONG_CALL)
        outcome = run_seed(settings, settings.world, seed, on_state, recorder.on_bytes)
        recorder.on_summary(outcome.end)
    if recorder.status.last_error is not None or recorder.status.dropped:
        why = recorder.status.last_error or "the disk was too slow"
        raise UserError(f"--out: the recording is not whole: {why}; make room or choose another place", FAILED)
    return outcome


def shown(place: Path, name: str, console: Console, units: Units) -> list[Path]:
    """Draw the recorded run and write its page; return all files."""
    from runtime.analysis.timeline_sources import TimelineSource
    from runtime.cli.commands.figures import draw_all
    from runtime.cli.commands.report import report

    timeline = read(TimelineSource(str(place / f"{name}.mcap")), console)
    page = place / f"{name}.html"
    report(timeline, page, console, units=units)
    return [timeline.path, page, *draw_all(timeline, place, console, moving=True, units=units)]


def run_scenes(
    scene: SceneName,
    sets: Sequence[str],
    *,
    models: Sequence[str],
    seeds: int,
    json_file: str | None,
    units: Units,
) -> int:
    """Carry out the command with ``--scene``; see `runtime.cli.app.experiment`."""
    _refuse_no_seeds(seeds)
    settings = load_settings("hallway", sets, models=models)
    console = Console(stderr=True)
    prepare_kernels(settings, console)
    from runtime.cycle.summary import write_json
    from runtime.simulation.open_loop import run_scene, summarise_scene

    runs = track(range(seeds), "driving", console=console, transient=True, disable=not console.is_terminal)
    outcome = summarise_scene(
        scene, [hall for seed in runs for hall in run_scene(settings, scene, seed)], settings.models
    )
    if json_file is not None:
        write_json(json_file, outcome)
    out = Console()
    if len(outcome["drums"]) + len(outcome["boxes"]) <= ROWS_SHOWN:
        if outcome["drums"]:
            out.print(table_2(outcome, units))
        if outcome["boxes"]:
            out.print(boxes_table(outcome, units))
    out.print(scene_line(outcome, units), soft_wrap=True)
    return DONE


def _refuse_no_seeds(seeds: int) -> None:
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: must be at least 1", WRONG_CALL)


def one_way(settings: Settings) -> Settings:
    """Return the settings with the drive ending at the end of its leg, as the paper's does."""
    ahead = settings.behaviors.move_ahead
    if ahead.distance_m is None:
        raise UserError("behaviors.move_ahead.distance_m is not set: the experiment needs an end", WRONG_CALL)
    behaviors = settings.behaviors.model_copy(update={"move_ahead": ahead.model_copy(update={"at_end": "stop"})})
    return settings.model_copy(update={"behaviors": behaviors})
