"""`echolocate run`: the robot's main process, on a serial port or on an emulated robot."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.settings import Settings
from runtime import VERSION
from runtime.cli.commands.foxglove import check_foxglove, foxglove_beside
from runtime.cli.commands.offer import plugged_in
from runtime.cli.commands.output_files import check_outputs, refuse_existing
from runtime.cli.commands.run_recording import RunRecording, open_run_recording
from runtime.cli.commands.run_settings import reload_settings, settings_of_files, with_port
from runtime.cli.first_signals import is_remembered
from runtime.cli.start_signals import ending_the_start, handled_by_loop
from runtime.cli.tables import objects_table, timing_line, timing_table, walls_table
from runtime.cli.terminal.escaping_console import EscapingConsole
from runtime.support.config_lint import lint_settings
from runtime.support.file_lock import file_lock
from runtime.support.kernel_cache import EMULATOR, is_compiled
from runtime.support.kernel_loader import KernelPreparation, begin_preparation
from runtime.support.length_format import Units
from runtime.support.logs import LogStatus, log_path, open_log
from runtime.support.restart import Restart, restart_refusal
from runtime.support.sd_notify import SdNotifier
from runtime.support.user_folders import state_folder
from runtime.timing.run_clock import RunClock, ScaledClock

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.cycle.line_messages import LineMessages
    from runtime.cycle.process import OnCycle, RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.cycle.step import CycleRecord, State
    from runtime.cycle.summary import RunSummary
    from runtime.simulation.emulator_process import EmulatorHandle
    from runtime.timing.cycle_stats import CycleStats
    from runtime.timing.time_control import TimeControl


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


def run_robot(
    config: str | None,
    sets: Sequence[str],
    *,
    robot: str | None,
    port: str | None,
    arm: bool,
    seconds: float | None,
    headless: bool,
    record: str | None,
    map_file: str | None,
    mission: str | None,
    goal: str | None,
    no_record: bool,
    no_console: bool,
    foxglove: bool,
    json_file: str | None,
    force: bool,
    emulator: EmulatorOptions,
    units: Units,
) -> int:
    """Run the robot until the run is ended, print its summary and return the exit code.

    Parameters
    ----------
    config, sets, robot, port, arm, seconds, headless, record, map_file, mission, no_record, no_console, json_file
        As of `runtime.cli.robot_commands.run`.
    foxglove, goal, force, units
        As of `runtime.cli.robot_commands.run`.
    emulator : EmulatorOptions
        Used without a port.

    Raises
    ------
    UserError
        An option is wrong, a file cannot be written, the run ended in FAULT, or the recording is incomplete.
    """
    if seconds is not None and not seconds > 0.0:
        raise UserError(f"--seconds {seconds}: must be above 0", WRONG_CALL)
    if foxglove:
        check_foxglove(no_console=no_console)
    settings = settings_of_files(
        config, sets, emulator.world, robot, map_file, mission, goal=goal, no_console=no_console
    )
    console = EscapingConsole(stderr=True)
    live = not headless and console.is_terminal and not console.is_dumb_terminal
    was_chosen = False
    plugged = [] if (port or settings.link.port) is not None else plugged_in()
    if plugged and live and sys.stdin.isatty() and not emulator.is_chosen:
        from runtime.cli.commands.offer import ask_for_robot

        found = ask_for_robot(plugged, None if config is None and robot is None else settings, console, sys.stdin)
        if found is not None:
            port, robot, arm, was_chosen = found.port, found.robot or robot, False, True
            settings = settings_of_files(
                config, sets, emulator.world, robot, map_file, mission, goal=goal, no_console=no_console
            )
    port_option, port = port, port if port is not None else settings.link.port
    if port is not None:
        settings = with_port(settings, port)
    own_files = {"--record": record, "--json": json_file}
    restart = Restart(restart_refusal({**own_files, "--trace": emulator.trace}, force=force, was_chosen=was_chosen))
    check_outputs(
        {**own_files, "--trace": emulator.trace}, (emulator.faults, port), force=force,
        appended={"log.file": log_path(settings.log)},
    )  # fmt: skip
    preparation = begin_preparation(settings)
    log_status = LogStatus()
    with contextlib.ExitStack() as stack:
        for option, path in own_files.items():
            if path is not None:
                stack.enter_context(file_lock(Path(path), f"{option} {path}"))
        refuse_existing(own_files, force=force)  # another run may have written them while kernels were prepared
        clock = ScaledClock() if port is None else RunClock()

        async def run() -> tuple[RunSummary, RunRecording]:
            from runtime.simulation.emulator_process import start_emulator
            from runtime.timing.time_control import NoTimeControl

            async with contextlib.AsyncExitStack() as running:
                running.enter_context(ending_the_start())  # until `signals` takes over
                emulator_start: asyncio.Task[EmulatorHandle] | None = None
                if isinstance(clock, ScaledClock):  # first of all: it takes as long as what follows
                    arguments = emulator.arguments(config, sets, robot)
                    starting = start_emulator(arguments, clock, compiled=is_compiled(EMULATOR))
                    emulator_start = asyncio.create_task(running.enter_async_context(starting), name="emulator")
                    running.push_async_callback(_end_task, emulator_start)
                    await asyncio.sleep(0.0)
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
                from runtime.cycle.line_messages import ProgramLine, messages_on

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
                    run_settings, log, console, clock=clock, control=control, live=live, units=units,
                    recording=recording, log_status=log_status, arm=arm or port is None, seconds=seconds,
                    foxglove=foxglove, restart=restart, emulated=port is None, preparation=preparation,
                    line_messages=line_messages,
                    reload=lambda: reload_settings(
                        config, sets, emulator.world, port_option, None if port else run_settings.link.port,
                        robot=robot, map_file=map_file, mission=mission, goal=goal, no_console=no_console,
                    ),
                )  # fmt: skip
                return summary, recording

        summary, recording = asyncio.run(run())
        recording.on_summary(summary)
    if recording.summary_row is not None:
        summary["recording"] = recording.summary_row
    summary["log"] = {"lost": log_status.lost, "last_error": log_status.last_error}
    if json_file is not None:
        from runtime.cycle.summary import write_json

        write_json(json_file, summary)
    output = EscapingConsole()
    output.print(objects_table(summary["objects"], units))
    if summary["walls"]:
        output.print(walls_table(summary["walls"], units))
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


async def _end_task(task: asyncio.Task[EmulatorHandle]) -> None:
    """End a start that failed while another did too; its own error, if it has one, has been raised."""
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def import_rest() -> None:
    """Import what a run uses beside its cycles; that takes a third of a second."""
    import runtime.cli.commands.serve_console
    import runtime.cycle.process  # noqa: F401 - for the modules alone


async def run_process(
    settings: Settings,
    log: FilteringBoundLogger,
    console: Console,
    *,
    clock: RunClock,
    control: TimeControl,
    live: bool,
    units: Units,
    recording: RunRecording,
    log_status: LogStatus,
    arm: bool,
    seconds: float | None,
    foxglove: bool,
    restart: Restart,
    emulated: bool,
    preparation: KernelPreparation | None,
    line_messages: LineMessages,
    reload: Callable[[], Settings],
) -> RunSummary:
    """Run the robot's process with live view, console, signals and keys; return the summary of the run.

    Parameters
    ----------
    settings, log, clock
        As of `runtime.cycle.process.RobotProcess`.
    console : rich.console.Console
        The terminal.
    control : TimeControl
        Of the run.
    live : bool
        Whether the live view is shown.
    units : {"m", "ft"}
        Units of view and console.
    recording : RunRecording
        Of the run.
    log_status : LogStatus
        Of the run's log.
    arm, seconds
        As of `runtime.cycle.process.RobotProcess.run`.
    foxglove : bool
        Whether the run is served to Foxglove.
    restart : Restart
        Is asked to start the run again.
    emulated : bool
        Whether the robot is emulated.
    preparation : KernelPreparation, optional
        Prepares recognition beside the run; None if it is ready.
    line_messages : LineMessages
        About the line.
    reload : callable
        Reads the settings again.
    """
    from runtime.cli.terminal.keys import keys
    from runtime.cli.terminal.time_keys import TimeKeys
    from runtime.cli.terminal.view import View
    from runtime.cycle.process import RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.support.kernel_loader import KernelLoader

    async with contextlib.AsyncExitStack() as stack:
        view = View(settings, console, units) if live else None
        listeners: list[OnCycle] = [] if view is None else [view.on_cycle]

        def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
            for listener in listeners:
                listener(record, state, stats, driver)

        observers = recording.observers(on_cycle, log)
        process = RobotProcess(
            settings, log, observers, clock, stack.enter_context(SdNotifier.from_environment()), preparation,
            line_messages,
        )  # fmt: skip
        if preparation is not None:
            stack.push_async_callback(preparation.close)
        kernel_loader = KernelLoader(log, preparation=preparation)
        reloader = Reloader(process.live_settings, reload, log, kernel_loader)
        if settings.log.webhook is not None:
            from runtime.support.webhook import Webhook

            hook = Webhook(settings.log.webhook, settings.log.webhook_period_s, settings.robot.name or "the robot")
            stack.enter_context(hook.sending())
            log_status.listeners.append(hook.on_log)
            stack.callback(log_status.listeners.remove, hook.on_log)
        if settings.console.enabled:
            from runtime.cli.commands.local_runs import shown_local_runs
            from runtime.cli.commands.network_presence import on_the_network
            from runtime.cli.commands.serve_console import serve_console
            from runtime.support.console_address import announced

            page = await stack.enter_async_context(
                serve_console(
                    process, settings, log, kernel_loader, recording, control, emulated=emulated, units=units,
                    reload=reload, restart=restart,
                )
            )  # fmt: skip
            log_status.listeners.append(page.hub.on_log)
            stack.callback(log_status.listeners.remove, page.hub.on_log)
            listeners.append(page.on_cycle)
            stack.enter_context(announced(page.url, folder := state_folder()))
            await stack.enter_async_context(shown_local_runs(page.url, folder, page.show_local_runs))
            presence = await stack.enter_async_context(on_the_network(page, process, settings.console, log))
            if presence is not None:
                listeners.append(presence.on_cycle)
            if foxglove:
                await stack.enter_async_context(foxglove_beside(page.url, log))
            if view is not None:
                for line in page.hints():
                    console.print(line, markup=False, highlight=False, soft_wrap=True)
                view.console_url = page.url
        stack.enter_context(signals(process, reloader))
        if view is not None:
            view.is_paused = lambda: control.is_paused
            clock.on_change(view.draw_again)
            stack.enter_context(view.shown())
            stack.enter_context(keys(process.request, process.stop, TimeKeys(control, log).press))
            process.health.watch("view", view.probe)
        for name, probe in {"recorder": recording.probe, "log": log_status.probe, "reload": reloader.probe}.items():
            process.health.watch(name, probe)
        summary = await process.run(arm=arm, seconds=seconds)
        summary["process"]["compilations"] -= kernel_loader.loaded  # they delayed no cycle
        return summary


@contextlib.contextmanager
def signals(process: RobotProcess, reloader: Reloader) -> Iterator[None]:
    """Handle signals during a run: INT and TERM end it, USR1 arms the robot, USR2 halts it, HUP reloads the settings.

    A USR2 that came during the start halts the robot before its first cycle, so that it is not armed by itself.
    If the reloaded configuration is wrong, the errors go to the log and the settings in force remain.
    """
    from runtime.cycle.inputs import Request

    handlers: dict[signal.Signals, Callable[[], None]] = {
        signal.SIGINT: process.stop,
        signal.SIGTERM: process.stop,
        signal.SIGUSR1: lambda: process.request(Request.ARM),
        signal.SIGUSR2: lambda: process.request(Request.HALT),
        signal.SIGHUP: reloader.request,
    }
    halting = signal.getsignal(signal.SIGUSR2)
    with handled_by_loop(handlers):
        if is_remembered(halting):
            process.request(Request.HALT)
        try:
            yield
        finally:
            reloader.cancel()
