"""`echolocate foxglove`, and the same beside a run: a live run in Foxglove."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import TYPE_CHECKING, Annotated, Final

from config.errors import DONE, WRONG_CALL, UserError
from runtime.cli.commands.offline_io import require_package
from runtime.cli.commands.ros2 import console_finder, until_interrupted
from runtime.cli.options import Connect, Flag, TcpPort
from runtime.support.child_process import ECHOLOCATE, kill_child, start_child

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger

CONSOLE: Final = "ECHOLOCATE_CONSOLE"
"""The variable by which a run gives its own Foxglove server its start URL, which is a secret."""
PACKAGE: Final = ("foxglove", "foxglove-sdk", "export")


def foxglove(
    *,
    connect: Connect = None,
    host: str = "127.0.0.1",
    port: TcpPort = 8766,
    allow_set: Annotated[bool, Flag] = False,
    print_layout: Annotated[bool, Flag] = False,
) -> int:
    """Serve a live run to Foxglove, with the topics of `export --to foxglove`.

    Parameters
    ----------
    host
        Address to listen on. Foxglove's protocol has no token: any program that reaches this port sees the run.
    port
        TCP port.
    allow_set
        Let Foxglove change settings of the run.
    print_layout
        Print a layout to import into Foxglove instead.

    Raises
    ------
    UserError
        The package is missing, or the port is in use.
    """
    if print_layout:
        import orjson

        from runtime.bridges.foxglove_layout import layout

        sys.stdout.write(orjson.dumps(layout(), option=orjson.OPT_INDENT_2).decode() + "\n")
        return DONE
    import asyncio

    require_package(*PACKAGE)
    from runtime.bridges.foxglove_live import serve_foxglove

    find = console_finder(connect or os.environ.get(CONSOLE))
    asyncio.run(until_interrupted(serve_foxglove(find, host, port, _report, allow_set=allow_set)))
    return DONE


def check_foxglove(*, no_console: bool) -> None:
    """Check the option `--foxglove` of a run.

    Raises
    ------
    UserError
        The package is missing, or there is no console to be a client of.
    """
    if no_console:
        raise UserError(
            "--foxglove needs the console: leave out --no-console, or set console.enabled=true", WRONG_CALL
        )
    require_package(*PACKAGE)


@asynccontextmanager
async def foxglove_beside(url: str, log: FilteringBoundLogger) -> AsyncIterator[None]:
    """Serve the run of this process to Foxglove while the context lasts, in a process of low priority.

    Parameters
    ----------
    url : str
        The run's start URL.
    log : structlog logger
        Gets what the process reports; if it ends, the run goes on.
    """
    import asyncio

    process = await start_child(ECHOLOCATE, ["foxglove"], pipes=False, low_priority=True, environment={CONSOLE: url})

    async def pass_on() -> None:
        while process.stderr is not None and (line := await process.stderr.readline()):
            log.info("foxglove", text=line.decode("utf-8", "replace").strip())
        log.warning("the process that serves Foxglove has ended")

    passing = asyncio.create_task(pass_on(), name="foxglove")
    try:
        yield
    finally:
        passing.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await passing
        await kill_child(process)


def _report(text: str) -> None:
    sys.stderr.write(f"echolocate: {text}\n")
    sys.stderr.flush()
