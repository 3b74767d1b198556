"""`echolocate experiment`: the paper's experiments in virtual time."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.progress import track

from config.load import load_settings
from config.settings import Settings
from runtime.commands.firing import refuse_impossible_firing
from runtime.complaint import DONE, WRONG_CALL, Complaint
from runtime.kernels import ready_kernels
from runtime.scene_names import SceneName
from runtime.tables import Units, boxes_table, scene_verdict, table_2, verdict

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
    json_file: str | None,
    units: Units,
) -> int:
    """Carry out the command; see `runtime.cli.experiment`."""
    _refuse_no_seeds(seeds)
    settings = one_way(load_settings(name, sets, world=world, models=models))
    if settings.world is None or not settings.world.drum:
        raise Complaint("the world holds no drum: the experiment sets drums seen against drums there", WRONG_CALL)
    refuse_impossible_firing(settings.ring)
    console = Console(stderr=True)
    ready_kernels(settings, console)
    from runtime.experiment import run_seed, summarise
    from runtime.summary import write_json

    runs = track(range(seeds), "driving", console=console, transient=True, disable=not console.is_terminal)
    outcome = summarise([run_seed(settings, settings.world, seed) for seed in runs])
    if json_file is not None:
        write_json(json_file, outcome)
    out = Console()
    if seeds <= SEEDS_SHOWN:
        out.print(table_2(outcome, units))
    out.print(verdict(outcome, units), soft_wrap=True)
    return DONE


def run_scenes(
    scene: SceneName,
    sets: Sequence[str],
    *,
    models: Sequence[str],
    seeds: int,
    json_file: str | None,
    units: Units,
) -> int:
    """Carry out the command with ``--scene``; see `runtime.cli.experiment`."""
    _refuse_no_seeds(seeds)
    settings = load_settings("hallway", sets, models=models)
    console = Console(stderr=True)
    ready_kernels(settings, console)
    from runtime.open_loop import run_scene, summarise_scene
    from runtime.summary import write_json

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
    out.print(scene_verdict(outcome, units), soft_wrap=True)
    return DONE


def _refuse_no_seeds(seeds: int) -> None:
    if seeds < 1:
        raise Complaint(f"--seeds {seeds}: must be at least 1", WRONG_CALL)


def one_way(settings: Settings) -> Settings:
    """Return the settings with the drive ending at the end of its leg, as the paper's does."""
    ahead = settings.behaviors.move_ahead
    if ahead.distance_m is None:
        raise Complaint("behaviors.move_ahead.distance_m is not set: the experiment needs an end", WRONG_CALL)
    behaviors = settings.behaviors.model_copy(update={"move_ahead": ahead.model_copy(update={"at_end": "stop"})})
    return settings.model_copy(update={"behaviors": behaviors})
