"""`echolocate fleet`: one page for the runs of this machine and of others."""

from __future__ import annotations

import asyncio
import sys
import time
from collections.abc import Sequence

from config.errors import DONE
from runtime.cli.commands.ros2 import until_interrupted
from runtime.support.console_address import find_consoles
from runtime.support.user_folders import state_folder


def serve_fleet_page(urls: Sequence[str], host: str, port: int) -> int:
    """Serve the fleet page until interrupted, and return the exit code.

    Parameters
    ----------
    urls, host, port
        As of `runtime.bridges.fleet_server.serve_fleet`.

    Raises
    ------
    UserError
        A URL is wrong, or the port is in use.
    """
    from runtime.bridges.fleet import Fleet
    from runtime.bridges.fleet_server import serve_fleet

    async def serve() -> None:
        fleet = Fleet(time.monotonic, lambda: find_consoles(state_folder()))
        await serve_fleet(fleet, host, port, urls, _tell)

    asyncio.run(until_interrupted(serve()))
    return DONE


def _tell(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()
