"""`echolocate replay` of a recording: verify it, show it at a chosen speed, or compare it with other settings."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import load_robot, load_settings, override_settings
from runtime.cli.commands.offline_io import plain_console
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.commands.replay.replay_options import RecordingOptions, ReplayOptions
from runtime.cli.tables import objects_table, polylines_line, walls_table
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.cycle.summary import PerceivedRows, perceived_rows, write_json
from runtime.recording.replay_summary import ReplaySummary
from runtime.support.kernel_warmup import prepare_kernels
from runtime.support.length_format import Units, format_length
from runtime.support.progress import progress

if TYPE_CHECKING:
    from config.settings import Settings
    from runtime.analysis.comparison import RunOutcome
    from runtime.recording.reader import Recording
    from runtime.recording.replayer import Replayer, ReplayStep
    from runtime.recording.verification import OnStep, ReplayResult


def replay_recording(log: str, both: ReplayOptions, recorded: RecordingOptions, *, force: bool) -> int:
    """Replay a recording, print the outcome and return the exit code.

    Parameters
    ----------
    log, both, recorded, force
        As of `runtime.cli.commands.replay.replay.replay`.

    Raises
    ------
    UserError
        Options contradict each other, the recording cannot be read, or with `verify` it is not reproduced.
    """
    from runtime.recording.reader import open_recording

    recorded.validate()
    has_other_settings = recorded.other is not None or bool(both.sets or both.model) or both.robot is not None
    for option, is_given in (
        ("--verify", recorded.verify),
        ("--json", both.json is not None),
        ("--from, --to, --speed", recorded.is_part or recorded.speed is not None),
    ):
        if is_given and has_other_settings:
            raise UserError(
                f"{option}: for the recorded settings only: leave out --with, --set, --model, --robot", WRONG_CALL
            )
    console = plain_console(stderr=True)
    with open_recording(Path(log)) as recording:
        if has_other_settings:
            settings = other_settings(recording, recorded.other, both.sets, robot=both.robot, models=both.model)
            return compare_with_settings(recording, settings, console, both.units)
        check_outputs({"--json": both.json}, (log,), force=force)
        return replay_again(recording, console, recorded, json_file=both.json, units=both.units)


def other_settings(
    recording: Recording, other: str | None, sets: Sequence[str], *, robot: str | None, models: Sequence[str]
) -> Settings:
    """Return the settings to compare with: those of a run file, or the recorded ones with overrides.

    Parameters
    ----------
    recording : Recording
        The recording.
    other, sets, robot, models
        As of `runtime.cli.commands.replay.replay.replay`.
    """
    if other is not None:
        return load_settings(other, sets, robot=robot, models=models)
    changes: dict[str, object] = {"models": load_settings(None, models=models).models} if models else {}
    if robot is not None:
        changes |= dict(load_robot(robot))
    return override_settings(recording.settings.model_copy(update=changes), str(recording.path), sets)


def replay_again(
    recording: Recording, console: Console, part: RecordingOptions, *, json_file: str | None, units: Units
) -> int:
    """Replay with the recorded settings, print what differs and return the exit code.

    Parameters
    ----------
    recording : Recording
        The recording.
    console : Console
        Where progress and notes are shown.
    part : RecordingOptions
        What is replayed.
    json_file, units
        As of `replay_recording`.

    Raises
    ------
    UserError
        There is no cycle to replay, or with `verify` the replay differs.
    """
    from runtime.recording.recorder import software_versions
    from runtime.recording.verification import verify_recording

    prepare_kernels(recording.settings, console)
    now, then = software_versions(), recording.info.versions
    others = [f"{name} {then.get(name)} → {now[name]}" for name in now if then.get(name) != now[name]]
    if others:
        console.print(f"recorded by another version or machine: {', '.join(others)}; results may differ")
    until_s = math.inf if part.until_s is None else part.until_s
    with contextlib.ExitStack() as stack:
        if part.speed is not None:
            on_step = stack.enter_context(live_view(recording, part.speed, units))
        else:
            advance = stack.enter_context(progress(console, "replaying"))

            def on_step(_step: ReplayStep, _replayer: Replayer) -> None:
                advance()

        result = verify_recording(recording, since_s=part.since_s, until_s=until_s, on_step=on_step)
    if result.cycles == 0:
        if result.skipped or part.is_part:
            raise UserError(f"{recording.path}: this part of it holds no cycle that can be replayed", FAILED)
        console.print(f"{recording.path}: holds no cycle yet: the run ended before its first one; nothing differs")
        if json_file is not None:
            write_json(json_file, replay_summary(recording, result))
        return DONE
    summary = replay_summary(recording, result)
    if json_file is not None:
        write_json(json_file, summary)
    output = plain_console()
    output.print(objects_table(summary["objects"], units))
    if summary["walls"]:
        output.print(walls_table(summary["walls"], units))
    if summary["polylines"]:
        output.print(polylines_line(summary["polylines"], units))
    for line in _what_is_not_compared(recording, result):
        console.print(line)
    stops = sorted(result.refinement_stops.items())
    causes = ", ".join(f"{'nothing to refine' if cause == 'nothing' else cause} {count}" for cause, count in stops)
    output.print(
        f"{result.cycles} cycles from cycle {result.first_cycle} on, {result.differences} differences, "
        f"{result.keyframes} keyframes compared; why refinement stopped, and how often: {causes}; "
        f"{result.times_real_time:.0f} times real time"
    )
    if result.first_difference is not None:
        if part.verify:
            raise UserError(f"{recording.path}: the replay differs, first in {result.first_difference}", FAILED)
        console.print(f"the replay differs, first in {result.first_difference}")
    return DONE


def _what_is_not_compared(recording: Recording, result: ReplayResult) -> list[str]:
    """Return a line for each part of the recording that is damaged, is missing, or was passed over."""
    from runtime.recording.verification import refused_lines

    lines = [str(region) for region in recording.corrupt_regions]
    lines += [
        f"cycles {first} to {last} are missing in the recording; replay continues at the next keyframe"
        for first, last in result.missing
    ]
    lines += refused_lines(result.refused)
    if result.skipped:
        lines.append(f"{result.skipped} cycles of the recording could not be replayed and are not compared")
    return lines


def replay_summary(recording: Recording, result: ReplayResult) -> ReplaySummary:
    """Return what `--json` writes of a replay: what was perceived at its end, and what was compared.

    The keys are public: users' programs read them. `segments` counts all since the start, `clusters` the present
    hypotheses of either method. Without a cycle there are empty lists and zeros.
    """
    perception = result.state.perception if result.state is not None else None
    perceived: PerceivedRows = {"objects": [], "walls": [], "corners": [], "canyons": [], "polylines": []}
    if perception is not None:
        perceived = perceived_rows(perception)
    return {
        "objects": perceived["objects"],
        "walls": perceived["walls"],
        "corners": perceived["corners"],
        "canyons": perceived["canyons"],
        "polylines": perceived["polylines"],
        "segments": 0 if perception is None else perception.counts.segments_total,
        "clusters": 0 if perception is None else perception.counts.hypotheses,
        "cycles": result.cycles,
        "cycle_us": result.cycle_stats.cycle_us(),
        "verify": {
            "differences": result.differences,
            "first": None if result.first_difference is None else str(result.first_difference),
            "first_cycle": result.first_cycle,
            "keyframes": result.keyframes,
            "skipped": result.skipped,
            "missing": result.missing,
            "refinement": dict(result.refinement_stops),
            "times_real_time": round(result.times_real_time, 1),
            "refused_keyframes": result.refused,
            "damage": [str(region) for region in recording.corrupt_regions],
        },
    }


@contextlib.contextmanager
def live_view(recording: Recording, speed: float, units: Units) -> Iterator[OnStep]:
    """Pace a replay, and show it on a terminal; yield what to call for each step of it.

    Parameters
    ----------
    recording : Recording
        The recording.
    speed : float
        How many times as fast as the run it is shown.
    units : {"m", "ft"}
        Units of the table of objects.
    """
    from drivers.registry import make_driver
    from runtime.cli.terminal.view import View
    from runtime.recording.channels import SERIAL, decode
    from runtime.recording.replayer import GAP_MAX_S
    from runtime.recording.schema import SerialBytes
    from runtime.timing.cycle_stats import CycleStats

    settings, console = recording.settings, EscapingConsole(stderr=True)
    view = View(settings, console, units) if console.can_draw else None
    say = console.print if view is None else view.print
    driver, stats = make_driver(settings), CycleStats(late_after_s=math.inf)
    driver.line_opened(0.0)
    last_run_s: float | None = None
    due_s = 0.0  # when the next cycle is due, by the host's clock

    def on_step(found: ReplayStep, replayer: Replayer) -> None:
        nonlocal last_run_s, due_s
        if found.message.topic == SERIAL["in"]:
            for run_s, data in decode(SerialBytes, found.message.data).pieces():
                driver.receive(data, run_s)
            driver.take_received()
        if found.replayed is None or replayer.state is None:
            return
        run_s, host_s = found.replayed.inputs.run_s, time.monotonic()
        if last_run_s is None:
            due_s = host_s
        else:
            gap_s = run_s - last_run_s
            if gap_s > GAP_MAX_S:
                say(f"no cycle for {gap_s:.0f} s before cycle {found.replayed.cycle}: shown as {GAP_MAX_S:g} s")
            due_s += min(max(gap_s, 0.0), GAP_MAX_S) / speed
        last_run_s = run_s
        if due_s > host_s:
            time.sleep(due_s - host_s)
        stats.add_cycle(0.0, max(0.0, host_s - due_s))
        if view is not None:
            view.on_cycle(found.replayed, replayer.state, stats, driver)

    with contextlib.ExitStack() as stack:
        if view is not None:
            stack.enter_context(view.shown())
        yield on_step


def compare_with_settings(recording: Recording, settings: Settings, console: Console, units: Units) -> int:
    """Replay with the recorded settings and with others, print what differs and return the exit code.

    Parameters
    ----------
    recording : Recording
        The recording.
    settings : Settings
        The other settings.
    console : Console
        Where progress is shown.
    units : {"m", "ft"}
        Units of the tables.
    """
    from runtime.analysis.comparison import compare_runs
    from runtime.recording.verification import refused_lines

    prepare_kernels(settings, console)
    with progress(console, "replaying") as advance:
        comparison = compare_runs(recording, settings, advance)
    output = plain_console()
    for line in refused_lines(comparison.refused):
        console.print(line)
    for title, run in (("as it was", comparison.recorded), ("with the other settings", comparison.other)):
        output.print(title)
        output.print(objects_table(run.objects, units))
        output.print(errors_line(run, units))
        for at_s, reason in run.stops:
            output.print(f"stopped after {at_s:.1f} s: {reason}")
    first = "" if comparison.first_change_s is None else f", the first after {comparison.first_change_s:.2f} s"
    output.print(f"{comparison.cycles} cycles; {comparison.changed_commands} with another command{first}")
    return DONE


def errors_line(run: RunOutcome, units: Units) -> str:
    """Return in one line how many drums of the true world were found, how many are false, and how far off they are.

    Where the true world is not known, the line gives the number of objects alone.
    """
    if run.errors_m is None:
        return f"{len(run.objects)} objects"
    found = [error for error in run.errors_m if error is not None]
    line = f"{len(found)} of {len(run.errors_m)} drums, {run.false} false"
    if not found:
        return line
    mean, worst = (format_length(error, units, 4) for error in (sum(found) / len(found), max(found)))
    return f"{line}; mean error {mean} {units}, worst {worst} {units}"
