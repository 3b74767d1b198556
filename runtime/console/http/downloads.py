"""Files sent to pages: piece by piece, read in a thread, so that neither disk nor network holds up the loop."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import BinaryIO, Final
from urllib.parse import quote

from aiohttp import web

PIECE_BYTES: Final = 64 * 1024
REST_S: Final = 0.002
"""Pause after each piece: about 30 MB/s, and the loop has most of the time for other work."""
TYPES: Final[Mapping[str, str]] = MappingProxyType(
    {
        ".html": "text/html; charset=utf-8",
        ".toml": "application/toml",
        ".yaml": "application/yaml",
        ".geojson": "application/geo+json",
        ".pgm": "image/x-portable-graymap",
    }
)
OTHER_TYPE: Final = "application/octet-stream"


async def send_file(request: web.BaseRequest, path: Path, headers: Mapping[str, str]) -> web.StreamResponse:
    """Send a file as it is now, and return the response; a page is shown, anything else saved by the browser.

    Of one that is being written, it is what is there. The headers are those of every response.

    Raises
    ------
    OSError
        It cannot be read.
    """
    file, size = await asyncio.to_thread(_open, path)
    try:
        response = web.StreamResponse(headers=dict(headers))
        response.headers["Content-Type"] = TYPES.get(path.suffix, OTHER_TYPE)
        if path.suffix != ".html":
            response.headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(path.name)}"
        response.content_length = size
        response.force_close()
        await response.prepare(request)
        left = size
        while left and (piece := await asyncio.to_thread(file.read, min(PIECE_BYTES, left))):
            left -= len(piece)
            await response.write(piece)
            await asyncio.sleep(REST_S)
        await response.write_eof()
        return response
    finally:
        file.close()


def _open(path: Path) -> tuple[BinaryIO, int]:
    file = path.open("rb")
    return file, os.fstat(file.fileno()).st_size
