"""`echolocate emulate`: a robot on a pseudo-terminal or a TCP port."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Final

from config.errors import DONE, WRONG_CALL, UserError
from config.load import load_settings
from runtime.cli.commands.output_files import check_outputs

if TYPE_CHECKING:
    from collections.abc import Callable

    from drivers.emulator.server import EmulatorPort

PIPES: Final = (0, 1)
"""Standard input and output, for the program that started this one."""
CLOCK_WRAP_S: Final = 2**32 * 1e-6
"""The robot's counter has 32 bits of microseconds."""


def emulate_robot(
    config: str | None,
    sets: Sequence[str],
    *,
    world: str | None,
    robot: str | None,
    link: str | None,
    tcp: str | None,
    faults: str | None,
    seed: int,
    trace: str | None,
    latency: str | None,
    force: bool,
    clock_s: float,
    end_with_parent: bool,
    control: bool,
) -> int:
    """Emulate a robot until interrupted and return the exit code.

    Parameters
    ----------
    config, sets, world, robot, link, tcp, faults, seed, trace, latency, force, clock_s, control
        As of `runtime.cli.robot_commands.emulate`.
    end_with_parent : bool
        Whether it ends when the process that started it ends.

    Raises
    ------
    UserError
        There is no world, an option is wrong, or a file cannot be written.
    """
    settings = load_settings(config, sets, world=world, robot=robot)
    from drivers.emulator.faults import load_faults
    from drivers.emulator.server import serve

    if settings.world is None:
        raise UserError("no world: name one with --world", WRONG_CALL)
    if not 0.0 <= clock_s < CLOCK_WRAP_S:
        raise UserError(f"--clock {clock_s:g}: must be from 0 to below {CLOCK_WRAP_S} s, where it wraps", WRONG_CALL)
    script = () if faults is None else load_faults(faults)
    check_outputs({"--trace": trace, "--latency": latency}, (faults, link), force=force)

    def ready(path: str) -> None:
        sys.stdout.write(f"ready on {path}\n")
        sys.stdout.flush()

    asyncio.run(
        serve(
            settings, settings.world, make_port=_port_maker(link, tcp), faults=script, seed=seed,
            trace_path=trace, latency_path=latency, ready=ready, exit_with_parent=end_with_parent,
            clock_start_us=round(1e6 * clock_s), control=PIPES if control else None,
        )
    )  # fmt: skip
    return DONE


def _port_maker(link: str | None, tcp: str | None) -> Callable[[], EmulatorPort]:
    if tcp is None:
        from drivers.emulator.pty_transport import PtyPort

        return partial(PtyPort, link)
    from drivers.emulator.tcp_transport import TcpServerPort, parse_address

    if link is not None:
        raise UserError("--link and --tcp: give one of them, there is one line", WRONG_CALL)
    return partial(TcpServerPort, *parse_address(tcp))
