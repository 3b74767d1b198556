"""`echolocate replay` of a ring log: perception over its firings."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from config.errors import DONE
from config.load import load_settings, with_known_room
from runtime.cli.commands.output_files import check_outputs, writing
from runtime.cli.commands.replay.replay_options import LocalizeOptions, ReplayOptions
from runtime.cli.tables import objects_table, polylines_line, pose_line, walls_table
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.cycle.summary import write_json
from runtime.recording.conventions.options import RingLogOptions
from runtime.support.kernel_cache import LOCALIZATION, needed_parts
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.progress import progress

TRAJECTORY_HEADER: Final = "t,x,y,theta,sxx,sxy,syy,stt,status"

if TYPE_CHECKING:
    from drivers.messages import Firing
    from perception.localization.localized_pose import LocalizedPose


def replay_log(
    log: str, both: ReplayOptions, localized: LocalizeOptions, options: RingLogOptions, *, force: bool
) -> int:
    """Run perception over a ring log, print the objects and return the exit code.

    Parameters
    ----------
    log, both, localized, options, force
        As of `runtime.cli.commands.replay.replay.replay`.
    """
    trajectory, path, map_file = localized.trajectory, localized.path, localized.map_file
    settings = load_settings(None, both.sets, robot=both.robot, models=both.model).of_log()
    if map_file is not None:
        settings = with_known_room(settings, map_file)
    console = EscapingConsole(stderr=True)
    check_outputs({"--json": both.json, "--trajectory": trajectory, "--path": path}, (log,), force=force)
    corrects_drift = localized.localize and map_file is None
    from runtime.recording.conventions.reading import check_begin, open_ring_log
    from runtime.recording.ring_log_replay import replay_firings, replay_in_known_room, replay_localized

    warnings: list[str] = []
    heard = open_ring_log(Path(log), settings, options, warnings.append)
    check_begin(Path(log), settings, options)  # an error in the call is said before kernels are compiled
    prepare_kernels(settings, console, (*needed_parts(settings), *([LOCALIZATION] if corrects_drift else [])))
    rows: list[str] = []
    path_rows: list[str] = []

    def on_pose(t: float, here: LocalizedPose) -> None:
        rows.append(trajectory_row(t, here))

    def on_path(t: float, here: LocalizedPose) -> None:
        path_rows.append(trajectory_row(t, here))

    with progress(console, "replaying") as step:
        firings = _each(heard, step)
        if map_file is not None:
            summary = replay_in_known_room(settings, firings, on_pose)
        elif corrects_drift:
            summary = replay_localized(settings, firings, on_pose, on_path)
        else:
            summary = replay_firings(settings, firings)
    for warning in warnings:
        console.print(f"echolocate: {warning}")
    for option, file, poses in (("--trajectory", trajectory, rows), ("--path", path, path_rows)):
        if file is not None:
            with writing(option, file):
                Path(file).write_text("\n".join([TRAJECTORY_HEADER, *poses, ""]), "utf-8")
    if both.json is not None:
        write_json(both.json, summary)
    output, units = EscapingConsole(), both.units
    output.print(objects_table(summary["objects"], units, frame=summary.get("frame", "odometry")))
    if summary["walls"]:
        output.print(walls_table(summary["walls"], units, frame=summary.get("frame", "odometry")))
    if summary["polylines"]:
        output.print(polylines_line(summary["polylines"], units))
    if "pose" in summary:
        output.print(pose_line(summary["pose"], units))
    cycle_us = summary["cycle_us"]
    output.print(
        f"{summary['cycles']} firings, {summary['segments']} outline segments, {summary['clusters']} clusters; "
        f"a firing takes {cycle_us['p50'] / 1e3:.2f} ms, p99 {cycle_us['p99'] / 1e3:.2f} ms"
    )
    return DONE


def trajectory_row(t: float, here: LocalizedPose) -> str:
    """Return a row of the trajectory, with the columns of `TRAJECTORY_HEADER`.

    Parameters
    ----------
    t : float
        Time of the firing, s.
    here : LocalizedPose
        The robot in the map frame, as known then.
    """
    p, pose = here.covariance, here.pose
    numbers = (t, pose.x, pose.y, pose.theta, p[0, 0], p[0, 1], p[1, 1], p[2, 2])
    return ",".join((*(f"{float(number):.9g}" for number in numbers), here.status))


def _each(firings: Iterable[Firing], step: Callable[[], None]) -> Iterator[Firing]:
    """Yield the firings and call `step` for each."""
    for firing in firings:
        step()
        yield firing
