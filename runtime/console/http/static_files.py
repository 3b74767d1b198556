"""The page's own files: read once, held in memory, served by name from a fixed list, so that no path leads out."""

from __future__ import annotations

from importlib.resources import files
from types import MappingProxyType
from typing import Final, NamedTuple

from config.errors import FAILED, UserError

KINDS: Final = MappingProxyType(
    {
        ".html": "text/html; charset=utf-8",
        ".js": "text/javascript; charset=utf-8",
        ".css": "text/css; charset=utf-8",
        ".svg": "image/svg+xml",
        ".png": "image/png",
    }
)
INDEX: Final = "index.html"


class File(NamedTuple):
    """A file as it is served."""

    body: bytes
    kind: str


def page_files() -> dict[str, File]:
    """Return every file of the page by the path it is asked for.

    Raises
    ------
    UserError
        The page is not installed.
    """
    served, folder = {}, files("runtime.console") / "page"
    for entry in folder.iterdir() if folder.is_dir() else ():
        name = entry.name
        kind = KINDS.get(name[name.rfind(".") :])
        if kind is not None and entry.is_file():
            served[f"/page/{name}"] = File(entry.read_bytes(), kind)
    index = served.get(f"/page/{INDEX}")
    if index is None:
        raise UserError(
            "the console's page is not installed: install the program again, or run without it (--no-console)", FAILED
        )
    return {"/": index, **served}


def headers(host: str) -> dict[str, str]:
    """Return what every answer carries: nothing from elsewhere, in no frame, kept nowhere, told to nobody.

    Parameters
    ----------
    host : str
        As the browser calls this server; named for the websocket, which not every browser counts as 'self'.
    """
    policy = (
        f"default-src 'self'; connect-src 'self' ws://{host}; img-src 'self' data: blob:; object-src 'none'; "
        "base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Server": "echolocate",
    }
