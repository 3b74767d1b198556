"""A run on the local network: announced to others, and the others shown on its page, by a process beside it."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Final

import orjson

from config.settings import ConsoleConfig
from runtime.console.console import Console
from runtime.console.http.auth import is_loopback
from runtime.support.child_process import kill_child, start_child

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

    from drivers.driver import RobotDriver
    from runtime.console.protocols import Run
    from runtime.cycle.step import CycleRecord, State
    from runtime.timing.cycle_stats import CycleStats

PROGRAM: Final = "runtime.bridges.local_network"
"""The module that announces a run and finds others, as a program."""
UNSENT_MAX: Final = 4096
"""With more bytes than this unsent, the process takes nothing, and a change is not sent to it."""
GOODBYE_MAX_S: Final = 0.5
"""Time for that process to end by itself, s."""
ROBOT: Final = "a robot without a name"


class NetworkPresence:
    """Keeps the process beside a run informed of the run's name and mode.

    Parameters
    ----------
    pipe : asyncio.StreamWriter
        Standard input of that process.
    run : Run
        The run.
    """

    def __init__(self, pipe: asyncio.StreamWriter, run: Run) -> None:
        self._pipe, self._run = pipe, run
        self._said = ("", "")
        """Name and mode that were sent last."""

    def on_cycle(self, record: CycleRecord, state: State, stats: CycleStats, driver: RobotDriver) -> None:
        """Send name and mode if they have changed; waits for nothing."""
        del record, stats, driver
        self.say(state.mode.mode.name)

    def say(self, mode: str) -> None:
        """Send the name and this mode if either has changed."""
        now = (self._run.name or ROBOT, mode)
        if now == self._said or self._pipe.transport.get_write_buffer_size() > UNSENT_MAX:
            return
        self._said = now
        self._pipe.write(orjson.dumps({"name": now[0], "mode": now[1]}) + b"\n")


@asynccontextmanager
async def on_the_network(
    page: Console, run: Run, config: ConsoleConfig, log: FilteringBoundLogger
) -> AsyncIterator[NetworkPresence | None]:
    """Announce a run and show the others on its page while the context lasts, where the settings say so.

    Parameters
    ----------
    page : Console
        The run's console, open.
    run : Run
        The run.
    config : ConsoleConfig
        Of the console.
    log : structlog logger
        Gets what the process reports; if it ends, the run goes on.
    """
    host, port = page.listening or ("", 0)
    if not is_announced(config, host):
        yield None
        return
    process = await start_child(PROGRAM, [host, str(port)], pipes=True, low_priority=True)
    if process.stdin is None or process.stdout is None or process.stderr is None:
        raise AssertionError("start_child gave no pipes")
    output, errors = process.stdout, process.stderr
    presence = NetworkPresence(process.stdin, run)
    presence.say(run.state.mode.mode.name)

    async def follow() -> None:
        with contextlib.suppress(ValueError, OSError):  # a line too long, which ours never are
            while line := await output.readline():
                page.show_robots(orjson.loads(line))
        page.show_robots([])
        why = (await errors.read()).decode("utf-8", "replace").strip().splitlines()
        log.warning("this run is not announced on the network any more", reason=why[-1] if why else "it ended")

    following = asyncio.create_task(follow(), name="robots on the network")
    try:
        yield presence
    finally:
        following.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await following
        process.stdin.close()  # it says goodbye to the network
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(GOODBYE_MAX_S):
                await process.wait()
        await kill_child(process)


def is_announced(config: ConsoleConfig, address: str) -> bool:
    """Return whether a run is announced whose console listens on this address.

    By default only where other machines can reach it, which can find it by trying as well. An address of IPv6 alone
    is not announced.
    """
    with contextlib.suppress(ValueError):
        if ipaddress.ip_address(address).version == 6 and address != "::":
            return False
    return config.announce == "always" or (config.announce == "when_open" and not is_loopback(address))
