"""The files of the page: read once and served from memory by their exact path, so that no path escapes the folder."""

from __future__ import annotations

from importlib.resources import files
from types import MappingProxyType
from typing import Final, NamedTuple

from config.errors import UserError

CONTENT_TYPES: Final = MappingProxyType(
    {
        ".html": "text/html; charset=utf-8",
        ".js": "text/javascript; charset=utf-8",
        ".css": "text/css; charset=utf-8",
        ".svg": "image/svg+xml",
        ".png": "image/png",
    }
)
INDEX: Final = "index.html"


class StaticFile(NamedTuple):
    """A file as it is served."""

    body: bytes
    content_type: str


def page_files() -> dict[str, StaticFile]:
    """Return every file of the page by its URL path.

    Raises
    ------
    UserError
        The page is not installed.
    """
    served, folder = {}, files("runtime.console") / "page"
    for entry in folder.iterdir() if folder.is_dir() else ():
        name = entry.name
        content_type = CONTENT_TYPES.get(name[name.rfind(".") :])
        if content_type is not None and entry.is_file():
            served[f"/page/{name}"] = StaticFile(entry.read_bytes(), content_type)
    index = served.get(f"/page/{INDEX}")
    if index is None:
        raise UserError(
            "the console's page is missing from the installation: install the program again, or run with --no-console"
        )
    return {"/": index, **served}


def security_headers(host: str) -> dict[str, str]:
    """Return the headers of a response where the Host is right: nothing foreign, embedded or cached, no referrer.

    The host is the request's, named for the websocket because not every browser counts that as 'self'.
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
