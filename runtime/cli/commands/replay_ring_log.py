"""`echolocate replay`: perception over a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Progress

from config.errors import DONE
from config.load import load_settings
from runtime.cli.tables import objects_table
from runtime.cycle.summary import write_json
from runtime.support.kernel_cache import prepare_kernels
from runtime.support.length_format import Units

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
    """Carry out the command; see `runtime.cli.app.replay`."""
    settings = load_settings(None, sets, robot=robot, models=models)
    console = Console(stderr=True)
    prepare_kernels(settings, console)
    from runtime.recording.ring_log import read_ring_log
    from runtime.recording.ring_log_replay import replay_firings

    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        firings = read_ring_log(Path(log), sensors=len(settings.ring.mounts))
        summary = replay_firings(settings, watched(firings, progress))
    if json_file is not None:
        write_json(json_file, summary)
    out = Console()
    out.print(objects_table(summary["objects"], units))
    took = summary["cycle_us"]
    out.print(
        f"{summary['cycles']} firings, {summary['segments']} outline segments, {summary['clusters']} clusters; "
        f"a firing takes {took['p50'] / 1e3:.2f} ms, p99 {took['p99'] / 1e3:.2f} ms"
    )
    return DONE


def watched(firings: Iterable[Firing], progress: Progress) -> Iterator[Firing]:
    """Yield `firings` while the progress shows how far along the recording they are."""
    task = progress.add_task("replaying", total=None)
    for firing in firings:
        progress.update(task, advance=1)
        yield firing
