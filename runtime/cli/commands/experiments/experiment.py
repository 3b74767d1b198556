"""`echolocate experiment`: the paper's experiments in virtual time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import Parameter
from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import plain_console, read_timeline
from runtime.cli.commands.output_files import check_outputs, make_output_folder
from runtime.cli.options import Count, Force, JsonFile, ModelFiles, Sets, Several, UnitsOption, WorldFile
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.simulation.scene_names import SceneName
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from config.settings import Settings
    from runtime.simulation.evaluation import SeedOutcome

QUEUE_MAX: Final = 1_000_000
"""Items that may wait to be recorded: virtual time runs faster than any disk writes."""
SEEDS_SHOWN: Final = 2
"""With more seeds, only the summary is printed."""
ROWS_SHOWN: Final = 24
"""Longer tables are not printed."""


@Parameter(name="*")
@dataclass(frozen=True)
class Experiment:
    """What all experiments have in common."""

    method: Annotated[Literal["paper", "bayes"], Parameter(help="How objects are recognised.")] = "bayes"
    models: Annotated[
        ModelFiles,
        Parameter(name="--model", help="Object models to recognise; by default those of the experiment."),
    ] = ()
    seeds: Annotated[Count, Parameter(help="Repeat with this many seeds, starting at 0.")] = 1
    json_file: JsonFile = None
    force: Force = False
    units: UnitsOption = "ft"
    overrides: Sets = ()

    @property
    def sets(self) -> tuple[str, ...]:
        """Settings that override the experiment's, its method among them; single settings have the last word."""
        return (f"perception.method={self.method}", *self.overrides)


ONE_SEED: Final = Experiment()


def experiment(
    name: Literal["hallway", "irregular", "budget", "drift", "canyon"],
    /,
    *,
    scene: SceneName | None = None,
    world: WorldFile = None,
    budget_ms: Annotated[tuple[float, ...], Several] = (0.2, 0.5, 1.0, 2.0, 5.0),
    quanta: Annotated[tuple[float, ...], Several] = (),
    out: str | None = None,
    common: Experiment = ONE_SEED,
) -> int:
    """Repeat an experiment of the paper in virtual time, and print its Table 2.

    Parameters
    ----------
    name
        The simulated hallway, the irregular hallway of the real run, the effect of smaller time budgets for
        perception in a hall of 40 drums, rounds among drums with drifting odometry, or drives to a goal behind a box
        canyon by several sets of schemas.
    scene
        Instead of driving, give perception the readings of this scene at exact poses.
    world
        World file to drive in instead of the experiment's own hall.
    budget_ms
        For `budget`: processor time of perception per cycle, ms.
    quanta
        For `budget`: refinement quanta per cycle instead of a time, which makes the table repeatable; 0.1 is one in
        ten cycles.
    out
        Folder for recording, figures and report of the run with seed 0.
    common
        What all experiments are given.

    Raises
    ------
    UserError
        The options exclude one another, or there are no seeds.
    """
    if common.seeds < 1:
        raise UserError(f"--seeds {common.seeds}: must be at least 1", WRONG_CALL)
    if scene is not None and out is not None:
        raise UserError(
            "--scene gives perception readings without a run: there is nothing to record in --out", WRONG_CALL
        )
    if name == "budget":
        from runtime.cli.commands.experiments.budget import run_budgets

        if scene is not None or world is not None or out is not None:
            raise UserError(
                "experiment budget has a hall of its own and records nothing: leave out --scene, --world and --out",
                WRONG_CALL,
            )
        return run_budgets(common, budget_ms, quanta)
    if name == "drift":
        from runtime.cli.commands.experiments.drift import run_drift

        if scene is not None or world is not None or out is not None:
            raise UserError(
                "experiment drift has a hall of its own and records nothing: leave out --scene, --world and --out",
                WRONG_CALL,
            )
        return run_drift(common)
    if name == "canyon":
        from runtime.cli.commands.experiments.canyon import run_canyons

        if scene is not None or world is not None or out is not None:
            raise UserError(
                "experiment canyon has worlds of its own and records nothing: leave out --scene, --world and --out",
                WRONG_CALL,
            )
        return run_canyons(common)
    if scene is not None:
        if name != "hallway" or world is not None:
            raise UserError("--scene is a hallway of its own: call `experiment hallway`, without --world", WRONG_CALL)
        return run_scenes(common, scene)
    return run_experiment(common, name, world, out)


def run_experiment(common: Experiment, name: str, world: str | None, out: str | None) -> int:
    """Drive through the experiment's hall once per seed, print the outcome and return the exit code.

    Raises
    ------
    UserError
        The settings do not describe an experiment, or a file cannot be written.
    """
    from config.load import load_settings
    from runtime.cli.tables import outcome_line, spread_line, table_2
    from runtime.simulation.evaluation import run_seed, stop_at_leg_end, summarise
    from runtime.support.pattern_check import refuse_undrivable

    models, seeds, json_file, units = common.models, common.seeds, common.json_file, common.units
    settings = stop_at_leg_end(load_settings(name, common.sets, world=world, models=models))
    if settings.world is None or not settings.world.drum:
        raise UserError("the world has no drum: the experiment compares what is recognised with drums", WRONG_CALL)
    refuse_undrivable(settings)
    console, output = EscapingConsole(stderr=True), plain_console()
    folder = None if out is None else make_output_folder(out)
    check_outputs(
        {"--out": [] if folder is None else run_files(folder, name), "--json": json_file}, force=common.force
    )
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


def run_scenes(common: Experiment, scene: SceneName) -> int:
    """Give perception the readings of a scene once per seed, print the outcome and return the exit code."""
    from config.load import load_settings
    from runtime.cli.tables import boxes_table, scene_line, table_2

    models, seeds, json_file, units = common.models, common.seeds, common.json_file, common.units
    settings = load_settings("hallway", common.sets, models=models)
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": json_file}, force=common.force)
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
