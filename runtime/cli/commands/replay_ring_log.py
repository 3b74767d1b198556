"""`echolocate replay` of a ring log: perception over its firings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE
from config.load import load_settings
from runtime.cli.commands.offline_io import refuse_unwritable
from runtime.cli.tables import objects_table
from runtime.cycle.summary import write_json
from runtime.support.kernel_cache import prepare_kernels
from runtime.support.length_format import Units
from runtime.support.progress import progress

if TYPE_CHECKING:
    from drivers.messages import Firing


def replay_log(
    log: str,
    sets: Sequence[str],
    *,
    robot: str | None,
    models: Sequence[str],
    json_file: str | None,
    units: Units,
) -> int:
    """Run perception over a ring log, print the objects and return the exit code.

    Parameters
    ----------
    log, sets, robot, models, json_file, units
        As of `runtime.cli.recording_commands.replay`.
    """
    settings = load_settings(None, sets, robot=robot, models=models)
    console = Console(stderr=True)
    refuse_unwritable({"--json": json_file})
    prepare_kernels(settings, console)
    from runtime.recording.ring_log import read_ring_log
    from runtime.recording.ring_log_replay import replay_firings

    with progress(console, "replaying") as step:
        firings = read_ring_log(Path(log), sensors=len(settings.ring.mounts))
        summary = replay_firings(settings, _each(firings, step))
    if json_file is not None:
        write_json(json_file, summary)
    output = Console()
    output.print(objects_table(summary["objects"], units))
    cycle_us = summary["cycle_us"]
    output.print(
        f"{summary['cycles']} firings, {summary['segments']} outline segments, {summary['clusters']} clusters; "
        f"a firing takes {cycle_us['p50'] / 1e3:.2f} ms, p99 {cycle_us['p99'] / 1e3:.2f} ms"
    )
    return DONE


def _each(firings: Iterable[Firing], step: Callable[[], None]) -> Iterator[Firing]:
    """Yield the firings and call `step` for each."""
    for firing in firings:
        step()
        yield firing
