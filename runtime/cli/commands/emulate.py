"""`echolocate emulate`: a robot on a pseudo-terminal or a TCP port."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.options import Count, Flag, Force, RobotFile, Sets, WorldFile
from runtime.timing.memory_policy import no_collection

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.emulator.server import EmulatorPort

PIPES: Final = (0, 1)
"""Standard input and output, for the program that started this one."""
CLOCK_WRAP_S: Final = 2**32 * 1e-6
"""The robot's counter has 32 bits of microseconds."""


@Parameter(name="*")
@dataclass(frozen=True)
class SettingsOptions:
    """Where the emulated robot and its world are described."""

    config: Annotated[str | None, Parameter(help="Run file that names robot and world.")] = None
    world: WorldFile = None
    robot: RobotFile = None
    sets: Sets = ()


@Parameter(name="*")
@dataclass(frozen=True)
class LineOptions:
    """The line on which the robot answers; by default a pseudo-terminal whose path is printed."""

    link: Annotated[str | None, Parameter(help="Create a symbolic link to the pseudo-terminal at this path.")] = None
    tcp: Annotated[
        str | None,
        Parameter(
            help="Listen on this TCP port of this machine, not on a pseudo-terminal; HOST:PORT to serve a network."
        ),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class TraceOptions:
    """Files that the emulator writes."""

    trace: Annotated[str | None, Parameter(help="Write the true poses to this file (CSV), 100 rows a second.")] = None
    latency: Annotated[
        str | None,
        Parameter(help="Write to this file (CSV) when each echo was sent and when each drive command arrived."),
    ] = None
    force: Force = False


RUN_FILE: Final = SettingsOptions()
PSEUDO_TERMINAL: Final = LineOptions()
NO_TRACE: Final = TraceOptions()


def emulate(
    *,
    described: SettingsOptions = RUN_FILE,
    line: LineOptions = PSEUDO_TERMINAL,
    traces: TraceOptions = NO_TRACE,
    faults: str | None = None,
    seed: Count = 0,
    clock: float = 0.0,
    control: Annotated[bool, Flag] = False,
    end_with_parent: Annotated[bool, Parameter(negative="", show=False)] = False,
) -> int:
    """Emulate a robot on a pseudo-terminal or a TCP port until interrupted.

    Parameters
    ----------
    described
        Where robot and world are described.
    line
        Where the robot answers.
    traces
        What is written.
    faults
        Fault script.
    seed
        Seed of everything random.
    clock
        Initial value of the robot's own clock, s; it wraps at 4294.967296.
    control
        Take time control from standard input, one line per request: time_scale NUMBER HOST_S RUN_S FACTOR UNTIL_S.
        From the host's monotonic time HOST_S on, the robot's time starts at RUN_S and runs FACTOR times as fast until
        UNTIL_S. The time reached is reported on standard output: acknowledged NUMBER RUN_S.
    end_with_parent
        End when the process that started the emulator has ended; for use by `run`.

    Raises
    ------
    UserError
        There is no world, an option is wrong, or a file cannot be written.
    """
    with no_collection():
        import asyncio

        from config.load import load_settings

        settings = load_settings(described.config, described.sets, world=described.world, robot=described.robot)
        from drivers.emulator.faults import load_faults
        from drivers.emulator.server import Service, serve

    if settings.world is None:
        raise UserError("no world: name one with --world", WRONG_CALL)
    if not 0.0 <= clock < CLOCK_WRAP_S:
        raise UserError(f"--clock {clock:g}: must be from 0 to below {CLOCK_WRAP_S} s, where it wraps", WRONG_CALL)
    script = () if faults is None else load_faults(faults)
    check_outputs({"--trace": traces.trace, "--latency": traces.latency}, (faults, line.link), force=traces.force)

    def ready(path: str) -> None:
        sys.stdout.write(f"ready on {path}\n")
        sys.stdout.flush()

    asyncio.run(
        serve(
            settings,
            settings.world,
            make_port=_port_maker(line),
            faults=script,
            seed=seed,
            ready=ready,
            service=Service(
                trace_path=traces.trace,
                latency_path=traces.latency,
                exit_with_parent=end_with_parent,
                clock_start_us=round(1e6 * clock),
                control=PIPES if control else None,
            ),
        )
    )
    return DONE


def _port_maker(line: LineOptions) -> Callable[[], EmulatorPort]:
    """Return what opens the emulator's end of the line, a TCP port or a pseudo-terminal."""
    if line.tcp is None:
        from drivers.emulator.pty_transport import PtyPort

        return partial(PtyPort, line.link)
    from drivers.emulator.tcp_transport import TcpServerPort, parse_address

    if line.link is not None:
        raise UserError("--link and --tcp: give one of them, there is one line", WRONG_CALL)
    return partial(TcpServerPort, *parse_address(line.tcp))
