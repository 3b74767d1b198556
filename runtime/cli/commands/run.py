"""`echolocate run`: the robot's main process, on a serial port or on an emulator of its own."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from config.errors import DONE, FAILED, WRONG_CALL, UserError
from config.load import ConfigError, load_settings
from config.settings import Settings
from runtime import VERSION
from runtime.cli.commands.firing_check import refuse_impossible_firing
from runtime.cli.commands.run_recording import RunRecording, kept
from runtime.cli.tables import objects_table, timing_line, timing_table
from runtime.support.config_lint import lint_settings
from runtime.support.file_lock import file_lock
from runtime.support.kernel_cache import prepare_kernels
from runtime.support.length_format import Units
from runtime.support.logs import LogStatus, open_log
from runtime.support.sd_notify import SdNotifier
from runtime.timing.run_clock import RunClock, ScaledClock

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.cli.commands.run_recording import OnCycle
    from runtime.cycle.process import RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.cycle.step import CycleRecord, State
    from runtime.cycle.summary import RunSummary
    from runtime.timing.cycle_stats import CycleStats
    from runtime.timing.time_control import TimeControl


@dataclass(frozen=True, slots=True)
class Emulation:
    """What the emulator is asked for where no port is given."""

    world: str | None
    seed: int
    trace: str | None
    faults: str | None

    def arguments(self, config: str | None, sets: Sequence[str]) -> list[str]:
        """Return the arguments of ``echolocate emulate`` that ask for it."""
        named = {
            "--config": config,
            "--world": self.world,
            "--seed": str(self.seed),
            "--trace": self.trace,
            "--faults": self.faults,
        }
        words = [word for option, value in named.items() if value is not None for word in (option, value)]
        return words + [word for text in sets for word in ("--set", text)]


def run_robot(
    config: str | None,
    sets: Sequence[str],
    *,
    port: str | None,
    arm: bool,
    seconds: float | None,
    headless: bool,
    record: str | None,
    no_record: bool,
    no_console: bool,
    json_file: str | None,
    emulation: Emulation,
    units: Units,
) -> int:
    """Carry out the command; see `runtime.cli.app.run`."""
    settings = load_settings(config, sets, world=emulation.world)
    refuse_impossible_firing(settings)
    if no_console:
        settings = without_console(settings)
    if seconds is not None and not seconds > 0.0:
        raise UserError(f"--seconds {seconds}: must be above 0", WRONG_CALL)
    given, port = port, port if port is not None else settings.link.port
    if port is not None:
        settings = on_port(settings, port)
    refuse_unwritable({"--record": record, "--json": json_file})
    console = Console(stderr=True)
    prepare_kernels(settings, console)
    live = not headless and console.is_terminal and not console.is_dumb_terminal
    lines = LogStatus()
    with contextlib.ExitStack() as stack:
        if record is not None:
            stack.enter_context(file_lock(Path(record), f"--record {record}"))
        clock = ScaledClock() if port is None else RunClock()
        keeping = stack.enter_context(kept(settings, record, no_record=no_record, emulated=port is None, clock=clock))
        log = stack.enter_context(open_log(settings.log, terminal=not live, listener=keeping.on_log, status=lines))
        log.info("start", version=VERSION, settings=settings.model_dump(mode="json"))
        for text in lint_settings(settings):
            log.warning(text)

        async def whole() -> RunSummary:
            from runtime.simulation.emulator_process import start_emulator
            from runtime.timing.time_control import NoTimeControl

            async with contextlib.AsyncExitStack() as running:
                chosen = settings
                control: TimeControl = NoTimeControl()
                if isinstance(clock, ScaledClock):
                    words = emulation.arguments(config, sets)
                    emulated, control = await running.enter_async_context(start_emulator(words, clock))
                    chosen = on_port(settings, emulated)
                return await watch(
                    chosen, log, console, clock=clock, control=control, live=live, units=units, keeping=keeping,
                    lines=lines, arm=arm or port is None, seconds=seconds, emulated=port is None,
                    propose=lambda: proposed(
                        config, sets, emulation.world, given, None if port else chosen.link.port,
                        no_console=no_console,
                    ),
                )  # fmt: skip

        summary = asyncio.run(whole())
        keeping.on_summary(summary)
    if keeping.standing is not None:
        summary["recording"] = keeping.standing
    summary["log"] = {"lost": lines.lost, "trouble": lines.trouble}
    if json_file is not None:
        from runtime.cycle.summary import write_json

        write_json(json_file, summary)
    out = Console()
    out.print(objects_table(summary["objects"], units))
    out.print(timing_table(summary))
    out.print(timing_line(summary))
    if lines.lost:
        out.print(f"{lines.lost} lines of the log are missing: {lines.trouble}; make room or choose another log.file")
    if summary["mode"] == "FAULT":
        raise UserError(summary["stop_reasons"][-1], FAILED)
    keeping.complain()
    return DONE


def refuse_unwritable(files: dict[str, str | None]) -> None:
    """Complain before the robot moves about a file that could not be written when it is done."""
    for option, path in files.items():
        try:
            if path is not None:
                Path(path).open("ab").close()
        except OSError as error:
            raise UserError(
                f"{option} {path}: cannot be written: {error.strerror}; choose another file", FAILED
            ) from error


def without_console(settings: Settings) -> Settings:
    """Return the settings with the console left out."""
    return settings.model_copy(update={"console": settings.console.model_copy(update={"enabled": False})})


def on_port(settings: Settings, port: str) -> Settings:
    """Return the settings with the serial port replaced."""
    return settings.model_copy(update={"link": settings.link.model_copy(update={"port": port})})


def proposed(
    config: str | None, sets: Sequence[str], world: str | None, given: str | None, emulated: str | None,
    *, no_console: bool = False,
) -> Settings:  # fmt: skip
    """Return the settings as the files hold them now, for a run on a port that was given, or is the emulator's.

    Raises
    ------
    ConfigError
        What is wrong with them, a firing pattern that the ring cannot carry out included.
    """
    settings = load_settings(config, sets, world=world)
    try:
        refuse_impossible_firing(settings)
    except UserError as complaint:
        raise ConfigError(str(complaint)) from complaint
    if no_console:
        settings = without_console(settings)
    port = given or settings.link.port or emulated
    return settings if port is None else on_port(settings, port)


async def watch(
    settings: Settings,
    log: FilteringBoundLogger,
    console: Console,
    *,
    clock: RunClock,
    control: TimeControl,
    live: bool,
    units: Units,
    keeping: RunRecording,
    lines: LogStatus,
    arm: bool,
    seconds: float | None,
    emulated: bool,
    propose: Callable[[], Settings],
) -> RunSummary:
    """Run the process under the eyes of view and console; it heeds signals and keys, and its parts are watched."""
    from runtime.cli.terminal.time_keys import TimeKeys
    from runtime.cli.terminal.view import View, keys
    from runtime.cycle.process import RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.support.kernel_loader import KernelLoader

    async with contextlib.AsyncExitStack() as stack:
        view = View(settings, console, units) if live else None
        watchers: list[OnCycle] = [] if view is None else [view.on_cycle]

        def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
            for watcher in watchers:
                watcher(record, state, stats, driver)

        observers = keeping.observers(on_cycle, log)
        process = RobotProcess(
            settings, log, observers, clock, notifier=stack.enter_context(SdNotifier.from_environment())
        )
        kernel_loader = KernelLoader(log)
        reloader = Reloader(process.live_settings, propose, log, kernel_loader)
        if settings.console.enabled:
            from runtime.cli.commands.serve_console import paged

            served = paged(
                process, settings, log, kernel_loader, keeping, control, emulated=emulated, units=units
            )
            page = await stack.enter_async_context(served)
            lines.listeners.append(page.hub.on_log)
            stack.callback(lines.listeners.remove, page.hub.on_log)
            watchers.append(page.on_cycle)
            if view is not None:
                for line in page.hints():
                    console.print(line, markup=False, highlight=False, soft_wrap=True)
                view.console_url = page.url
        stack.enter_context(signals(process, reloader))
        if view is not None:
            stack.enter_context(view.shown())
            stack.enter_context(keys(process.request, process.stop, TimeKeys(control, log).press))
            process.health.watch("view", view.probe)
        for name, probe in {"recorder": keeping.probe, "log": lines.probe, "reload": reloader.probe}.items():
            process.health.watch(name, probe)
        summary = await process.run(arm=arm, seconds=seconds)
        summary["process"]["compilations"] -= kernel_loader.loaded  # on purpose, and in no cycle's time
        return summary


@contextlib.contextmanager
def signals(process: RobotProcess, reloader: Reloader) -> Iterator[None]:
    """Heed signals: INT and TERM end the run in good order, USR1 arms and USR2 halts a robot without a keyboard.

    HUP has the configuration read again; what is wrong with it is told in the log and the last good one kept.
    """
    from runtime.cycle.inputs import Request

    loop = asyncio.get_running_loop()
    calls: dict[signal.Signals, Callable[[], None]] = {
        signal.SIGINT: process.stop,
        signal.SIGTERM: process.stop,
        signal.SIGUSR1: lambda: process.request(Request.ARM),
        signal.SIGUSR2: lambda: process.request(Request.HALT),
        signal.SIGHUP: reloader.request,
    }
    for number, call in calls.items():
        loop.add_signal_handler(number, call)
    try:
        yield
    finally:
        for number in calls:
            loop.remove_signal_handler(number)
        reloader.cancel()
