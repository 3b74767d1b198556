"""Who has the control: one client at a time, handed over on request, lost with the connection.

Whoever comes first with the token has it; later ones watch, and may ask. A holder who is asked and stays idle for a
while loses it, so that a page left open somewhere cannot keep everybody from the controls; to halt nobody needs it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

PATIENCE_S: Final = 10.0
"""A holder who is asked and does nothing for so long gives it up."""


class Holder(Protocol):
    """A client, as far as this file cares."""

    @property
    def number(self) -> int:
        """Its own among all of this run."""

    @property
    def name(self) -> str:
        """For people."""

    @property
    def has_token(self) -> bool:
        """Whether it may do more than watch."""


class Control:
    """The control over one robot.

    Parameters
    ----------
    tell : callable
        Gets every client whose role is another one or that should know who asks, and who that is.
    left : callable
        Gets the client that had the control until now.
    """

    def __init__(self, tell: Callable[[Holder, Holder | None], None], left: Callable[[Holder], None]) -> None:
        self._tell = tell
        self._left = left
        self._holder: Holder | None = None
        self._asker: Holder | None = None
        self._patience_ends_s = 0.0

    def has(self, client: Holder) -> bool:
        """Say whether this one has the control."""
        return self._holder is client

    def join(self, client: Holder) -> None:
        """Take note of a new client, which has the control where nobody else does; nobody is told."""
        if self._holder is None and client.has_token:
            self._holder = client

    def leave(self, client: Holder) -> None:
        """Take note that a client is gone."""
        if self._asker is client:
            self._asker = None
        if self._holder is client:
            self._pass_to(self._asker)

    def take(self, client: Holder, now_s: float) -> str | None:
        """Take the control, or ask for it; return why it is not taken yet. Who has it keeps it so when asked."""
        if self._holder is client:
            self._asker = None
            return None
        if self._holder is None:
            self._pass_to(client)
            return None
        self._patience_ends_s = now_s + PATIENCE_S
        self._asker = client
        self._tell(self._holder, client)
        return (
            f"{self._holder.name} has the control and has been asked for it; "
            f"unless it is used, it is yours in {PATIENCE_S:.0f} s"
        )

    def give(self) -> None:
        """Give it up: to whoever asked for it, or to nobody."""
        self._pass_to(self._asker)

    def grant(self, number: int) -> str | None:
        """Hand it over to the client that asked; return why not."""
        if self._asker is None or self._asker.number != number:
            return f"client {number} does not ask for the control"
        self._pass_to(self._asker)
        return None

    def used(self, client: Holder, now_s: float) -> None:
        """Take note that a client did something with it."""
        if self._holder is client:
            self._patience_ends_s = now_s + PATIENCE_S

    def expire(self, now_s: float) -> None:
        """Hand it over where a request has been left unanswered for too long."""
        if self._asker is not None and now_s >= self._patience_ends_s:
            self._pass_to(self._asker)

    def _pass_to(self, client: Holder | None) -> None:
        before, self._holder, self._asker = self._holder, client, None
        if before is not None and before is not client:
            self._left(before)
            self._tell(before, None)
        if client is not None:
            self._tell(client, None)
