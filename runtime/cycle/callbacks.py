"""Names of the callbacks that the loop runs between two cycles, as the timing table shows them."""

from __future__ import annotations

from typing import Final

LINE_OPENED: Final = "line opened"
LINK_RECEIVE: Final = "link receive"
LINE_SEND: Final = "line send"
LINE_LOST: Final = "line lost"
COLLECTION: Final = "garbage collection"
CONSOLE_RECEIVE: Final = "console receive"
CONSOLE_FRAME: Final = "console frame"
CONSOLE_SEND: Final = "console send"
VIEW: Final = "view"
CALLBACKS: Final = (
    LINE_OPENED,
    LINK_RECEIVE,
    LINE_SEND,
    LINE_LOST,
    COLLECTION,
    CONSOLE_RECEIVE,
    CONSOLE_FRAME,
    CONSOLE_SEND,
    VIEW,
)
"""All of them."""
