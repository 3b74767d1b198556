"""`echolocate emulate`: a robot on a pseudo-terminal or a TCP port."""

from __future__ import annotations

import sys
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.output_files import check_outputs
from runtime.cli.options import ConfigFile, Count, Flag, Force, RobotFile, Sets, WorldFile
from runtime.timing.memory_policy import no_collection

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.emulator.server import EmulatorPort

PIPES: Final = (0, 1)
"""Standard input and output, for the program that started this one."""
CLOCK_WRAP_S: Final = 2**32 * 1e-6
"""The robot's counter has 32 bits of microseconds."""


def emulate(
    *,
    world: WorldFile = None,
    link: str | None = None,
    tcp: str | None = None,
    faults: str | None = None,
    seed: Count = 0,
    robot: RobotFile = None,
    trace: str | None = None,
    latency: str | None = None,
    force: Force = False,
    clock: float = 0.0,
    control: Annotated[bool, Flag] = False,
    config: ConfigFile = None,
    sets: Sets = (),
    end_with_parent: Annotated[bool, Parameter(negative="", show=False)] = False,
) -> int:
    """Emulate a robot on a pseudo-terminal or a TCP port until interrupted.

    Parameters
    ----------
    link
        Create a symbolic link to the pseudo-terminal at this path.
    tcp
        Listen on this TCP port of this machine in place of a pseudo-terminal; HOST:PORT to serve a network.
    faults
        Fault script.
    seed
        Seed of everything random.
    trace
        Write the true poses to this file (CSV), 100 rows a second.
    latency
        Write to this file (CSV) when each echo was sent and when each drive command arrived.
    force
        Overwrite files that exist already.
    clock
        Initial value of the robot's own clock, s; it wraps at 4294.967296.
    control
        Take time control from standard input, one line per request: time_scale NUMBER HOST_S RUN_S FACTOR UNTIL_S.
        From the host's monotonic time HOST_S on, the robot's time starts at RUN_S and runs FACTOR times as fast until
        UNTIL_S. The time reached is reported on standard output: acknowledged NUMBER RUN_S.
    config
        Run file that names robot and world.
    world
        World file, or the name of a shipped one; None for that of the run file.
    robot
        Robot file, or the name of a shipped one; None for that of the run file.
    sets
        Single settings, each `path=value`, that override the files'.
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

        settings = load_settings(config, sets, world=world, robot=robot)
        from drivers.emulator.faults import load_faults
        from drivers.emulator.server import Service, serve

    if settings.world is None:
        raise UserError("no world: name one with --world", WRONG_CALL)
    if not 0.0 <= clock < CLOCK_WRAP_S:
        raise UserError(f"--clock {clock:g}: must be from 0 to below {CLOCK_WRAP_S} s, where it wraps", WRONG_CALL)
    script = () if faults is None else load_faults(faults)
    check_outputs({"--trace": trace, "--latency": latency}, (faults, link), force=force)

    def ready(path: str) -> None:
        sys.stdout.write(f"ready on {path}\n")
        sys.stdout.flush()

    asyncio.run(
        serve(
            settings,
            settings.world,
            make_port=_port_maker(link, tcp),
            faults=script,
            seed=seed,
            ready=ready,
            service=Service(
                trace_path=trace,
                latency_path=latency,
                exit_with_parent=end_with_parent,
                clock_start_us=round(1e6 * clock),
                control=PIPES if control else None,
            ),
        )
    )
    return DONE


def _port_maker(link: str | None, tcp: str | None) -> Callable[[], EmulatorPort]:
    if tcp is None:
        from drivers.emulator.pty_transport import PtyPort

        return partial(PtyPort, link)
    from drivers.emulator.tcp_transport import TcpServerPort, parse_address

    if link is not None:
        raise UserError("--link and --tcp: give one of them, there is one line", WRONG_CALL)
    return partial(TcpServerPort, *parse_address(tcp))
