"""The other runs of this user on this machine, shown on the page of a run."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit

from config.errors import UserError
from runtime.support.console_address import find_consoles

LOOK_S: Final = 3.0
"""Interval at which the folder of addresses is read, s; in a thread, which takes a fraction of a millisecond."""
NAME: Final = "another run of this machine"


@asynccontextmanager
async def shown_local_runs(
    own_url: str, folder: Path, show: Callable[[list[dict[str, Any]]], None]
) -> AsyncIterator[None]:
    """Show the other runs of this machine while the context lasts.

    Parameters
    ----------
    own_url : str
        The start URL of this run, which is left out.
    folder : Path
        The program's state folder.
    show : callable
        Gets name, mode, url and version of each when they have changed; without tokens.
    """

    async def watch() -> None:
        shown: list[dict[str, Any]] = []
        while True:
            rows = await asyncio.to_thread(other_runs, own_url, folder)
            if rows != shown:
                shown = rows
                show(rows)
            await asyncio.sleep(LOOK_S)

    watching = asyncio.create_task(watch(), name="runs of this machine")
    try:
        yield
    finally:
        watching.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await watching


def other_runs(own_url: str, folder: Path) -> list[dict[str, Any]]:
    """Return the rows of the other runs, by address; the address of a run on any interface is this machine's own."""
    try:
        urls = find_consoles(folder)
    except UserError:
        return []
    own = urlsplit(own_url).netloc
    places = sorted({place for url in urls if (place := urlsplit(url).netloc) != own})
    return [{"name": NAME, "mode": "", "url": f"http://{place}/", "version": ""} for place in places]
