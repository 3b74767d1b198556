"""`echolocate run`: the robot's main process, on a serial port or on an emulated robot."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from runtime.cli.commands.run.run_settings import SettingsFiles
from runtime.cli.options import ConfigFile, Count, Flag, Force, JsonFile, UnitsOption
from runtime.timing.memory_policy import no_collection

if TYPE_CHECKING:
    import asyncio
    import contextlib

    from rich.console import Console

    from runtime.cli.commands.run.run_plan import RunPlan
    from runtime.cli.commands.run.run_recording import RunRecording
    from runtime.cli.terminal.view import View
    from runtime.cycle.summary import RunSummary
    from runtime.simulation.emulator_process import EmulatorHandle
    from runtime.support.length_format import Units
    from runtime.timing.time_control import TimeControl


@Parameter(name="*")
@dataclass(frozen=True)
class EmulatorOptions:
    """Options of the emulator that a run without a port starts."""

    seed: Annotated[Count, Parameter(help="Emulated robot: seed of everything random.")] = 0
    trace: Annotated[str | None, Parameter(help="Emulated robot: write its true poses to this file (CSV).")] = None
    faults: Annotated[str | None, Parameter(help="Emulated robot: fault script.")] = None

    def arguments(self, files: SettingsFiles, *, force: bool) -> list[str]:
        """Return the command line of ``echolocate emulate`` with these options.

        Parameters
        ----------
        files : SettingsFiles
            Where robot and world are described.
        force : bool
            Whether the trace may overwrite an existing file.
        """
        named = {
            "--config": files.config,
            "--robot": files.robot,
            "--world": files.world,
            "--seed": str(self.seed),
            "--trace": self.trace,
            "--faults": self.faults,
        }
        words = [word for option, value in named.items() if value is not None for word in (option, value)]
        overrides = [word for text in files.sets for word in ("--set", text)]
        return [*words, *(["--force"] if force else []), *overrides]


@Parameter(name="*")
@dataclass(frozen=True)
class OutputOptions:
    """What a run writes and prints."""

    record: Annotated[
        str | None,
        Parameter(
            help="Record into this file, not the folder of recordings; a name that ends in .csv gives a ring log."
        ),
    ] = None
    no_record: Annotated[bool, Flag, Parameter(help="Record nothing.")] = False
    json: JsonFile = None
    force: Force = False
    units: UnitsOption = "m"


SHIPPED: Final = SettingsFiles()
UNDISTURBED: Final = EmulatorOptions()
RECORDED: Final = OutputOptions()


@no_collection()
def run(
    config: ConfigFile = None,
    /,
    *,
    port: str | None = None,
    arm: Annotated[bool, Flag] = False,
    seconds: float | None = None,
    headless: Annotated[bool, Flag] = False,
    foxglove: Annotated[bool, Flag] = False,
    files: SettingsFiles = SHIPPED,
    emulator: EmulatorOptions = UNDISTURBED,
    outputs: OutputOptions = RECORDED,
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
    foxglove
        Serve the run to Foxglove as well, from a process of its own; see `echolocate foxglove`.
    config
        Run file, or the name of a shipped one; None for the default settings.
    files
        What describes robot, world and mission.
    emulator
        How the emulated robot behaves.
    outputs
        What is written and printed.

    Raises
    ------
    UserError
        An option is wrong, a file cannot be written, the run ended in FAULT, or the recording is incomplete.
    """
    import asyncio
    import contextlib

    from runtime import VERSION
    from runtime.cli.commands.output_files import check_outputs, refuse_existing
    from runtime.cli.commands.run.offer import Offered, ask_for_robot, plugged_in
    from runtime.cli.commands.run.run_plan import RunPlan
    from runtime.cli.commands.run.run_settings import with_port
    from runtime.cli.terminal.escaping_console import EscapingConsole
    from runtime.support.file_lock import file_lock
    from runtime.support.logs import LogStatus, log_path
    from runtime.support.restart import Restart, restart_refusal
    from runtime.timing.run_clock import RunClock, ScaledClock

    files, json, force = replace(files, config=config), outputs.json, outputs.force
    settings = files.read_unchecked()
    check_options(seconds, outputs, foxglove=foxglove, no_console=not settings.console.enabled)
    console = EscapingConsole(stderr=True)
    live = not headless and console.can_draw
    if live:
        console.print(f"echolocate {VERSION} is starting", highlight=False)
    plugged = [] if (port or settings.link.port) is not None else plugged_in()
    found: Offered | None = None
    if plugged and live and sys.stdin.isatty() and (files.world, emulator) == (None, UNDISTURBED):
        found = ask_for_robot(plugged, settings if files.name_a_robot else None, console, sys.stdin)
    if found is not None:
        port, arm, files = found.port, False, replace(files, robot=found.robot or files.robot)
        settings = files.read_unchecked()
    port_option, port = port, port if port is not None else settings.link.port
    if port is not None:
        refuse_emulated(files, emulator)
        settings = with_port(settings, port)
    own_files = {"--record": outputs.record, "--json": json}
    restart = Restart(
        restart_refusal({**own_files, "--trace": emulator.trace}, force=force, was_chosen=found is not None)
    )
    check_outputs(
        {**own_files, "--trace": emulator.trace},
        (emulator.faults, port),
        force=force,
        appended={"log.file": log_path(settings.log)},
    )
    plan = RunPlan(
        settings=settings,
        files=files,
        port=port_option,
        clock=ScaledClock() if port is None else RunClock(),
        log_status=LogStatus(),
        restart=restart,
        units=outputs.units,
        emulated=port is None,
        arm=arm,
        seconds=seconds,
        foxglove=foxglove,
        record=outputs.record,
        no_record=outputs.no_record,
    )
    with contextlib.ExitStack() as stack:
        for option, path in _given(own_files):
            stack.enter_context(file_lock(Path(path), f"{option} {path}"))
        refuse_existing(own_files, force=force)  # another run may have written them while kernels were prepared
        arguments = emulator.arguments(files, force=force)
        try:
            summary, recording = asyncio.run(_whole_run(plan, arguments, plugged, console if live else None, stack))
        except UserError as error:
            from runtime.cycle.summary import failed_start

            _write_json(json, failed_start(str(error)))  # else the file that is locked stays empty
            raise
        recording.on_summary(summary)
    summary |= {} if recording.summary_row is None else {"recording": recording.summary_row}
    summary["log"] = {"lost": plan.log_status.lost, "last_error": plan.log_status.last_error}
    try:
        _print_summary(summary, outputs.units)  # first: the disk may be full
    finally:  # the output may be a closed pipe
        _write_json(json, summary)
    restart.if_requested()
    if summary["mode"] == "FAULT":
        raise UserError(summary["stop_reasons"][-1], FAILED)
    recording.raise_if_incomplete()
    return DONE


def check_options(seconds: float | None, outputs: OutputOptions, *, foxglove: bool, no_console: bool) -> None:
    """Raise an error if a run can't last so long, be recorded so, or be served to Foxglove."""
    from runtime.cli.commands.foxglove import check_foxglove

    if seconds is not None and not seconds > 0.0:
        raise UserError(f"--seconds {seconds}: must be above 0", WRONG_CALL)
    if outputs.no_record and outputs.record is not None:
        raise UserError("--record and --no-record exclude each other: leave one of them out", WRONG_CALL)
    if foxglove:
        check_foxglove(no_console=no_console)


def refuse_emulated(files: SettingsFiles, emulator: EmulatorOptions) -> None:
    """Refuse the emulated robot's options for a run that has a port: they would do nothing, or set a world's goal.

    Raises
    ------
    UserError
        There is one.
    """
    given = {
        "--world": files.world is not None,
        "--seed": emulator.seed != UNDISTURBED.seed,
        "--trace": emulator.trace is not None,
        "--faults": emulator.faults is not None,
    }
    if named := [option for option, is_given in given.items() if is_given]:
        raise UserError(
            f"{', '.join(named)}: of the emulated robot, and this run has a port (--port or link.port); leave out "
            "one, or give them to `echolocate emulate`. A run file needs no option: `echolocate run office --port …`",
            WRONG_CALL,
        )


def _given(files: Mapping[str, str | None]) -> list[tuple[str, str]]:
    return [(option, path) for option, path in files.items() if path is not None]


def _write_json(path: str | None, summary: object) -> None:
    if path is not None:
        from runtime.cycle.summary import write_json

        write_json(path, summary)


async def _whole_run(
    plan: RunPlan,
    emulator_arguments: Sequence[str],
    plugged: Sequence[str],
    console: Console | None,
    stack: contextlib.ExitStack,
) -> tuple[RunSummary, RunRecording]:
    """Start what a run needs, the slowest first, and run it; return its summary and its recording.

    Parameters
    ----------
    plan : RunPlan
        Of the run.
    emulator_arguments : sequence of str
        Of the emulator, which is started only if the robot is emulated.
    plugged : sequence of str
        Serial ports that an emulated run mentions in its log.
    console : Console, optional
        Where the live view is shown; None without one.
    stack : ExitStack
        Closes the log and the recording, after the run's summary was added to it.
    """
    import asyncio
    import contextlib

    from runtime import VERSION
    from runtime.cli.__main__ import main
    from runtime.cli.start_signals import ending_the_start
    from runtime.simulation.emulator_process import start_emulator
    from runtime.support.daemon_thread import in_daemon_thread
    from runtime.support.kernel_cache import EMULATOR, is_compiled
    from runtime.support.logs import open_log
    from runtime.timing.run_clock import ScaledClock

    settings = plan.settings
    async with contextlib.AsyncExitStack() as running:
        running.enter_context(ending_the_start())  # until `signals` takes over
        emulator_start: asyncio.Task[EmulatorHandle] | None = None
        if isinstance(plan.clock, ScaledClock):  # first of all: it takes as long as what follows
            compiled = is_compiled(EMULATOR)
            starting = start_emulator(emulator_arguments, plan.clock, compiled=compiled, main=main)
            emulator_start = asyncio.create_task(running.enter_async_context(starting), name="emulator")
            running.push_async_callback(_end_task, emulator_start)
        if settings.console.enabled:  # meanwhile: it reads certificates, for which it needs no interpreter
            http = asyncio.create_task(in_daemon_thread(_import_http), name="import of HTTP")
            running.callback(http.cancel)
        await asyncio.sleep(0.0)
        view: View | None = None
        if console is not None:
            from runtime.cli.terminal.view import View

            view = View(settings, console, plan.units)
            running.enter_context(view.shown())
        from runtime.cli.commands.run.run_process import import_rest, run_process
        from runtime.cli.commands.run.run_recording import open_run_recording
        from runtime.cli.commands.run.run_settings import refuse_impossible
        from runtime.cycle.line_messages import ProgramLine, messages_on
        from runtime.support.config_lint import lint_settings
        from runtime.support.kernel_loader import begin_preparation
        from runtime.timing.time_control import NoTimeControl

        refuse_impossible(settings, plan.files.file)
        preparation = begin_preparation(settings)
        recording = stack.enter_context(
            open_run_recording(
                settings, plan.record, no_record=plan.no_record, emulated=plan.emulated, clock=plan.clock
            )
        )
        log = stack.enter_context(
            open_log(settings.log, terminal=console is None, listener=recording.on_log, status=plan.log_status)
        )
        log.info("start", version=VERSION, settings=settings.model_dump(mode="json"))
        for text in lint_settings(settings):
            log.warning(text)
        if plan.emulated and plugged:
            runs = f"`echolocate probe` names the robot, `echolocate run --port {plugged[0]}` runs it"
            log.info("serial port found", ports=plugged, hint=f"this run is emulated; {runs}")
        control: TimeControl = NoTimeControl()
        line_messages = messages_on(settings.link.port)
        importing = asyncio.create_task(in_daemon_thread(import_rest, emulated=plan.emulated))
        if preparation is not None:
            running.push_async_callback(preparation.close)
            if preparation.first_start is not None:
                log.info(preparation.first_start)
                if view is not None:
                    view.print(preparation.first_start)
            preparation.begin_ring(settings)
        await importing
        if emulator_start is not None:
            emulated = await emulator_start
            plan, control = plan.with_port(emulated.port), emulated.control
            line_messages = ProgramLine("the emulator", "start the run again", emulated.control.has_ended)
        summary = await run_process(
            plan,
            log,
            control=control,
            view=view,
            recording=recording,
            preparation=preparation,
            line_messages=line_messages,
        )
        return summary, recording


def _print_summary(summary: RunSummary, units: Units) -> None:
    """Print what a run found, its timing, and what became of its recording and its log."""
    from runtime.cli.tables import objects_table, polylines_line, timing_line, timing_table, walls_table
    from runtime.cli.terminal.escaping_console import EscapingConsole

    output = EscapingConsole()
    output.print(objects_table(summary["objects"], units))
    if summary["walls"]:
        output.print(walls_table(summary["walls"], units))
    if summary["polylines"]:
        output.print(polylines_line(summary["polylines"], units))
    output.print(timing_table(summary))
    output.print(timing_line(summary))
    recorded, log = summary.get("recording"), summary["log"]
    if recorded is not None and recorded["file"] is not None:
        output.print(f"recorded in {recorded['file']}", soft_wrap=True)
    if log["lost"]:
        output.print(
            f"{log['lost']} lines of the log are missing: {log['last_error']}; make room or choose another log.file"
        )


def _import_http() -> None:
    import aiohttp.web  # noqa: F401 - for the modules alone


async def _end_task(task: asyncio.Task[EmulatorHandle]) -> None:
    """End a start that failed while another did too; its own error, if it has one, has been raised."""
    import asyncio

    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
