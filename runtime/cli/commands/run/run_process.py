"""The robot's process in `echolocate run`, with live view, console, signals and keys."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from config.errors import UserError
from runtime.cli.commands.foxglove import foxglove_beside
from runtime.cli.commands.run.run_recording import RunRecording
from runtime.cli.first_signals import EXIT_CODE_BASE, is_remembered
from runtime.cli.start_signals import handled_by_loop
from runtime.support.kernel_loader import KernelPreparation
from runtime.support.sd_notify import SdNotifier
from runtime.support.user_folders import state_folder

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.cli.commands.run.run_plan import RunPlan
    from runtime.cli.terminal.view import View
    from runtime.cycle.line_messages import LineMessages
    from runtime.cycle.process import OnCycle, RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.cycle.step import CycleRecord, State
    from runtime.cycle.summary import RunSummary
    from runtime.timing.cycle_stats import CycleStats
    from runtime.timing.time_control import TimeControl


def import_rest(*, emulated: bool) -> None:
    """Import what a run uses beside its cycles; that takes a third of a second.

    On a robot's line another robot may answer, and its name must not keep a HALT waiting; an emulator starts sooner.
    """
    import runtime.cli.commands.run.serve_console
    import runtime.cycle.process  # noqa: F401 - for the modules alone

    if not emulated:
        from drivers.registry import import_families

        import_families()


async def run_process(
    plan: RunPlan,
    log: FilteringBoundLogger,
    *,
    control: TimeControl,
    view: View | None,
    recording: RunRecording,
    preparation: KernelPreparation | None,
    line_messages: LineMessages,
) -> RunSummary:
    """Run the robot's process with live view, console, signals and keys; return the summary of the run.

    Parameters
    ----------
    plan : RunPlan
        Of the run.
    log : FilteringBoundLogger
        As of `runtime.cycle.process.RobotProcess`.
    control : TimeControl
        Of the run.
    view : View, optional
        The live view, which is shown; None without one.
    recording : RunRecording
        Of the run.
    preparation : KernelPreparation, optional
        Prepares recognition beside the run; None if it is ready.
    line_messages : LineMessages
        About the line.
    """
    from runtime.cli.terminal.keys import keys
    from runtime.cli.terminal.time_keys import TimeKeys, noting_what_waits
    from runtime.cli.terminal.view import after_each_cycle
    from runtime.cycle.callbacks import VIEW
    from runtime.cycle.process import RobotProcess
    from runtime.cycle.reloader import Reloader
    from runtime.support.kernel_loader import KernelLoader

    settings, log_status = plan.settings, plan.log_status
    async with contextlib.AsyncExitStack() as stack:
        listeners: list[OnCycle] = []

        def on_cycle(record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
            for listener in listeners:
                listener(record, state, stats, driver)

        observers = recording.observers(on_cycle, log)
        if view is not None:
            observers = replace(observers, on_starting=view.print)
        process = RobotProcess(
            settings,
            log,
            observers,
            plan.clock,
            stack.enter_context(SdNotifier.from_environment()),
            preparation,
            line_messages,
        )
        if view is not None:
            listeners.append(after_each_cycle(process.timing_monitor.timed(VIEW, view.on_cycle)))
        if preparation is not None:
            stack.push_async_callback(preparation.close)
        kernel_loader = KernelLoader(log, preparation=preparation)
        reloader = Reloader(process.live_settings, plan.reload, log, kernel_loader)
        if settings.log.webhook is not None:
            from runtime.support.webhook import Webhook

            hook = Webhook(settings.log.webhook, settings.log.webhook_period_s, settings.robot.name or "the robot")
            stack.enter_context(hook.sending())
            log_status.listeners.append(hook.on_log)
            stack.callback(log_status.listeners.remove, hook.on_log)
        if settings.console.enabled:
            from runtime.cli.commands.run.local_runs import shown_local_runs
            from runtime.cli.commands.run.network_presence import on_the_network
            from runtime.cli.commands.run.serve_console import serve_console
            from runtime.support.console_address import announced

            page = await stack.enter_async_context(
                serve_console(
                    process,
                    log,
                    kernel_loader,
                    recording,
                    control,
                    emulated=plan.emulated,
                    units=plan.units,
                    reload=plan.reload,
                    restart=plan.restart,
                )
            )
            log_status.listeners.append(page.hub.on_log)
            stack.callback(log_status.listeners.remove, page.hub.on_log)
            listeners.append(page.on_cycle)
            stack.enter_context(announced(page.url, folder := state_folder()))
            await stack.enter_async_context(shown_local_runs(page.url, folder, page.show_local_runs))
            presence = await stack.enter_async_context(on_the_network(page, process, settings.console, log))
            if presence is not None:
                listeners.append(presence.on_cycle)
            if plan.foxglove:
                await stack.enter_async_context(foxglove_beside(page.url, log))
            if view is not None:
                for line in page.hints():
                    view.print(line)
                view.console_url = page.url
        ending = stack.enter_context(signals(process, reloader))
        if view is not None:
            view.is_paused = lambda: control.is_paused
            plan.clock.on_change(view.draw_again)
            on_request = noting_what_waits(process.request, control, view.print)
            stack.enter_context(keys(on_request, process.stop, TimeKeys(control, log).press, view.draw_again))
            process.health.watch("view", view.probe)
        for name, probe in {"recorder": recording.probe, "log": log_status.probe, "reload": reloader.probe}.items():
            process.health.watch(name, probe)
        summary = await process.run(arm=plan.is_armed, seconds=plan.seconds)
        if not process.is_connected:
            why = "ended{} before the robot was ready"
            if ending:
                raise UserError(why.format(f" by {ending[0].name}"), EXIT_CODE_BASE + ending[0])
            summary["stop_reasons"].append(why.format(""))
        summary["process"]["compilations"] -= kernel_loader.loaded  # they delayed no cycle
        return summary


@contextlib.contextmanager
def signals(process: RobotProcess, reloader: Reloader) -> Iterator[list[signal.Signals]]:
    """Handle signals during a run: INT and TERM end it, USR1 arms the robot, USR2 halts it, HUP reloads the settings.

    The list has those that ended the run, once they come.
    A USR2 that came during the start halts the robot before its first cycle, so that it is not armed by itself.
    If the reloaded configuration is wrong, the errors go to the log and the settings in force remain.
    """
    from runtime.cycle.inputs import Request

    ending: list[signal.Signals] = []

    def end(number: signal.Signals) -> None:
        ending.append(number)
        process.stop()

    handlers: dict[signal.Signals, Callable[[], None]] = {
        signal.SIGINT: partial(end, signal.SIGINT),
        signal.SIGTERM: partial(end, signal.SIGTERM),
        signal.SIGUSR1: lambda: process.request(Request.ARM),
        signal.SIGUSR2: lambda: process.request(Request.HALT),
        signal.SIGHUP: reloader.request,
    }
    halting = signal.getsignal(signal.SIGUSR2)
    with handled_by_loop(handlers):
        if is_remembered(halting):
            process.request(Request.HALT)
        try:
            yield ending
        finally:
            reloader.cancel()
