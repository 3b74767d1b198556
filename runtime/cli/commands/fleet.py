"""`echolocate fleet`: one page for the runs of this machine and of others."""

from __future__ import annotations

import sys
import time

from config.errors import DONE
from runtime.cli.commands.ros2 import until_interrupted
from runtime.cli.options import TcpPort
from runtime.support.console_address import find_consoles
from runtime.support.user_folders import state_folder


def fleet(
    *urls: str,
    host: str = "127.0.0.1",
    port: TcpPort = 8764,
) -> int:
    """Serve one page for several runs: mode, battery and place of each, HALT for one and for all.

    Runs of this machine appear by themselves.

    Parameters
    ----------
    urls
        Start URLs of runs on other machines, with their tokens.
    host
        Address to listen on; the page has a token of its own.
    port
        TCP port; 0 takes any that is free.

    Raises
    ------
    UserError
        A URL is wrong, or the port is in use.
    """
    import asyncio

    from runtime.bridges.fleet import Fleet
    from runtime.bridges.fleet_server import serve_fleet

    async def serve() -> None:
        runs = Fleet(time.monotonic, lambda: find_consoles(state_folder()))
        await serve_fleet(runs, host, port, urls, _tell)

    asyncio.run(until_interrupted(serve()))
    return DONE


def _tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
