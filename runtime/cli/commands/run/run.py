"""`echolocate run`: the robot's main process, on a serial port or on an emulated robot."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.options import ConfigFile, Count, Flag, Force, JsonFile, RobotFile, Sets, UnitsOption
from runtime.timing.memory_policy import no_collection

if TYPE_CHECKING:
    import asyncio

    from runtime.cli.commands.run.run_recording import RunRecording
    from runtime.cli.terminal.view import View
    from runtime.cycle.summary import RunSummary
    from runtime.simulation.emulator_process import EmulatorHandle
    from runtime.timing.time_control import TimeControl


@no_collection()
def run(
    config: ConfigFile = None,
    /,
    *,
    port: str | None = None,
    arm: Annotated[bool, Flag] = False,
    seconds: float | None = None,
    headless: Annotated[bool, Flag] = False,
    record: str | None = None,
    no_record: Annotated[bool, Flag] = False,
    no_console: Annotated[bool, Flag] = False,
    foxglove: Annotated[bool, Flag] = False,
    json: JsonFile = None,
    force: Force = False,
    map_file: Annotated[str | None, Parameter(name="--map")] = None,
    robot: RobotFile = None,
    world: str | None = None,
    mission: str | None = None,
    goal: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    seed: Count = 0,
    trace: str | None = None,
    faults: str | None = None,
    units: UnitsOption = "m",
    sets: Sets = (),
) -> int:
    """Run the robot's main process; without a port, on an emulated robot.

    Signals: SIGUSR1 arms the robot, SIGUSR2 halts it, SIGHUP reloads the run file, SIGINT and SIGTERM end the run.

    Parameters
    ----------
    port
        Port of the robot, a serial device or socket://host:port; the robot then waits in READY until it is armed.
    arm
        Arm the robot once, at the start. The emulated robot is armed without this option.
    seconds
        End the run this long after recognition began.
    headless
        Print log lines instead of the live view.
    record
        Record into this file instead of the folder of recordings; a name that ends in .csv gives a ring log.
    no_record
        Record nothing.
    no_console
        Do not serve the operator console.
    foxglove
        Serve the run to Foxglove as well, from a process of its own; see `echolocate foxglove`.
    map_file
        The known room in which the robot finds itself: a world file, or the name of a shipped one.
    robot
        Robot file, or the name of a shipped one; None for that of the run file.
    world
        Emulated robot: world file, or the name of a shipped one; without CONFIG its shipped run is driven.
    mission
        What to do once armed: a mission file, or the name of a shipped one; None for that of the run file.
    goal
        Where to drive once armed: X,Y in metres, or X,Y,HEADING with the final heading in degrees, or the name of a
        place. A place in the map with --map, otherwise in odometry's frame, from where the run begins.
    seed
        Emulated robot: seed of everything random.
    trace
        Emulated robot: write its true poses to this file (CSV).
    faults
        Emulated robot: fault script.
    config
        Run file, or the name of a shipped one; None for the default settings.
    json
        File for a summary at the end of the run (JSON); None for no file.
    force
        Overwrite files that exist already.
    units
        Units of the printed tables.
    sets
        Single settings, each `path=value`, that override the files'.

    Raises
    ------
    UserError
        An option is wrong, a file cannot be written, the run ended in FAULT, or the recording is incomplete.
    """
    import asyncio
    import contextlib

    from runtime import VERSION
    from runtime.cli.commands.foxglove import check_foxglove
    from runtime.cli.commands.output_files import check_outputs, refuse_existing
    from runtime.cli.commands.run.offer import ask_for_robot, plugged_in
    from runtime.cli.commands.run.run_settings import SettingsFiles, refuse_impossible, with_port
    from runtime.cli.start_signals import ending_the_start
    from runtime.cli.terminal.escaping_console import EscapingConsole
    from runtime.support.file_lock import file_lock
    from runtime.support.kernel_cache import EMULATOR, is_compiled
    from runtime.support.logs import LogStatus, log_path, open_log
    from runtime.support.restart import Restart, restart_refusal
    from runtime.timing.run_clock import RunClock, ScaledClock

    if seconds is not None and not seconds > 0.0:
        raise UserError(f"--seconds {seconds}: must be above 0", WRONG_CALL)
    if foxglove:
        check_foxglove(no_console=no_console)
    emulator = EmulatorOptions(world, seed, trace, faults, force=force)
    files = SettingsFiles(config, sets, robot, world, map_file, mission, goal, no_console=no_console)
    settings = files.read_unchecked()
    console = EscapingConsole(stderr=True)
    live = not headless and console.is_terminal and not console.is_dumb_terminal
    if live:
        console.print(f"echolocate {VERSION} is starting", highlight=False)
    was_chosen = False
    plugged = [] if (port or settings.link.port) is not None else plugged_in()
    if plugged and live and sys.stdin.isatty() and not emulator.is_chosen:
        found = ask_for_robot(plugged, None if config is None and robot is None else settings, console, sys.stdin)
        if found is not None:
            port, arm, was_chosen = found.port, False, True
            files = replace(files, robot=found.robot or robot)
            settings = files.read_unchecked()
    port_option, port = port, port if port is not None else settings.link.port
    if port is not None:
        settings = with_port(settings, port)
    own_files = {"--record": record, "--json": json}
    restart = Restart(restart_refusal({**own_files, "--trace": trace}, force=force, was_chosen=was_chosen))
    check_outputs(
        {**own_files, "--trace": trace},
        (faults, port),
        force=force,
        appended={"log.file": log_path(settings.log)},
    )
    log_status = LogStatus()
    with contextlib.ExitStack() as stack:
        for option, path in own_files.items():
            if path is not None:
                stack.enter_context(file_lock(Path(path), f"{option} {path}"))
        refuse_existing(own_files, force=force)  # another run may have written them while kernels were prepared
        clock = ScaledClock() if port is None else RunClock()

        async def whole_run() -> tuple[RunSummary, RunRecording]:
            from runtime.simulation.emulator_process import start_emulator

            async with contextlib.AsyncExitStack() as running:
                running.enter_context(ending_the_start())  # until `signals` takes over
                emulator_start: asyncio.Task[EmulatorHandle] | None = None
                if isinstance(clock, ScaledClock):  # first of all: it takes as long as what follows
                    arguments = emulator.arguments(config, sets, files.robot)
                    starting = start_emulator(arguments, clock, compiled=is_compiled(EMULATOR))
                    emulator_start = asyncio.create_task(running.enter_async_context(starting), name="emulator")
                    running.push_async_callback(_end_task, emulator_start)
                if settings.console.enabled:  # meanwhile: it reads certificates, for which it needs no interpreter
                    http = asyncio.create_task(asyncio.to_thread(_import_http), name="import of HTTP")
                    running.push_async_callback(asyncio.wait, [http])
                await asyncio.sleep(0.0)
                view: View | None = None
                if live:
                    from runtime.cli.terminal.view import View

                    view = View(settings, console, units)
                    running.enter_context(view.shown())
                from runtime.cli.commands.run.run_process import import_rest, run_process
                from runtime.cli.commands.run.run_recording import open_run_recording
                from runtime.cycle.line_messages import ProgramLine, messages_on
                from runtime.support.config_lint import lint_settings
                from runtime.support.kernel_loader import begin_preparation
                from runtime.timing.time_control import NoTimeControl

                refuse_impossible(settings)
                preparation = begin_preparation(settings)
                recording = stack.enter_context(
                    open_run_recording(settings, record, no_record=no_record, emulated=port is None, clock=clock)
                )
                log = stack.enter_context(
                    open_log(settings.log, terminal=not live, listener=recording.on_log, status=log_status)
                )
                log.info("start", version=VERSION, settings=settings.model_dump(mode="json"))
                for text in lint_settings(settings):
                    log.warning(text)
                if port is None and plugged:
                    runs = f"`echolocate probe` names the robot, `echolocate run --port {plugged[0]}` runs it"
                    log.info("serial port found", ports=plugged, hint=f"this run is emulated; {runs}")
                run_settings = settings
                control: TimeControl = NoTimeControl()
                line_messages = messages_on(port)
                importing = asyncio.create_task(asyncio.to_thread(import_rest))
                if preparation is not None:
                    preparation.begin_ring(settings)
                await importing
                if emulator_start is not None:
                    emulated = await emulator_start
                    run_settings, control = with_port(settings, emulated.port), emulated.control
                    line_messages = ProgramLine("the emulator", "start the run again", emulated.control.has_ended)
                summary = await run_process(
                    run_settings,
                    log,
                    clock=clock,
                    control=control,
                    view=view,
                    units=units,
                    recording=recording,
                    log_status=log_status,
                    arm=arm or port is None,
                    seconds=seconds,
                    foxglove=foxglove,
                    restart=restart,
                    emulated=port is None,
                    preparation=preparation,
                    line_messages=line_messages,
                    reload=lambda: files.read_again(port_option, None if port else run_settings.link.port),
                )
                return summary, recording

        try:
            summary, recording = asyncio.run(whole_run())
        except UserError as error:
            if json is not None:  # else the file that is locked stays empty
                from runtime.cycle.summary import failed_start, write_json

                write_json(json, failed_start(str(error)))
            raise
        recording.on_summary(summary)
    if recording.summary_row is not None:
        summary["recording"] = recording.summary_row
    summary["log"] = {"lost": log_status.lost, "last_error": log_status.last_error}
    if json is not None:
        from runtime.cycle.summary import write_json

        write_json(json, summary)
    from runtime.cli.tables import objects_table, polylines_line, timing_line, timing_table, walls_table

    output = EscapingConsole()
    output.print(objects_table(summary["objects"], units))
    if summary["walls"]:
        output.print(walls_table(summary["walls"], units))
    if summary["polylines"]:
        output.print(polylines_line(summary["polylines"], units))
    output.print(timing_table(summary))
    output.print(timing_line(summary))
    if recording.summary_row is not None and recording.summary_row["file"] is not None:
        output.print(f"recorded in {recording.summary_row['file']}", soft_wrap=True)
    if log_status.lost:
        output.print(
            f"{log_status.lost} lines of the log are missing: {log_status.last_error}; make room or choose another "
            "log.file"
        )
    restart.if_requested()
    if summary["mode"] == "FAULT":
        raise UserError(summary["stop_reasons"][-1], FAILED)
    recording.raise_if_incomplete()
    return DONE


def _import_http() -> None:
    import aiohttp.web  # noqa: F401 - for the modules alone


async def _end_task(task: asyncio.Task[EmulatorHandle]) -> None:
    """End a start that failed while another did too; its own error, if it has one, has been raised."""
    import asyncio

    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


@dataclass(frozen=True, slots=True)
class EmulatorOptions:
    """Options of the emulator that a run without a port starts."""

    world: str | None
    seed: int
    trace: str | None
    faults: str | None
    force: bool = False
    """Whether the trace may overwrite an existing file."""

    @property
    def is_chosen(self) -> bool:
        """Whether an option was given that has a meaning for the emulator only."""
        return any(option is not None for option in (self.world, self.trace, self.faults))

    def arguments(self, config: str | None, sets: Sequence[str], robot: str | None = None) -> list[str]:
        """Return the command line of ``echolocate emulate`` with these options."""
        named = {
            "--config": config,
            "--robot": robot,
            "--world": self.world,
            "--seed": str(self.seed),
            "--trace": self.trace,
            "--faults": self.faults,
        }
        words = [word for option, value in named.items() if value is not None for word in (option, value)]
        overrides = [word for text in sets for word in ("--set", text)]
        return [*words, *(["--force"] if self.force else []), *overrides]
