"""Control of the robot: held by one client at a time, handed over on request, released when its connection ends.

The first client with the token gets control; later ones watch and may request it. A holder who is asked and does not
react for a while loses control, so that an abandoned page does not block other clients. HALT needs no
control.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

REQUEST_TIMEOUT_S: Final = 10.0
"""A holder who is asked for control and does not use it for this long loses it: time enough to answer a banner."""


class Holder(Protocol):
    """A client, as far as control depends on it."""

    @property
    def number(self) -> int:
        """Unique in this run."""

    @property
    def name(self) -> str:
        """For operators."""

    @property
    def has_token(self) -> bool:
        """Whether it may do more than watch."""


class Control:
    """Which client has control of the robot, and which has requested it.

    `notify` gets each client whose role changed or that is asked for control, and the client that asks, if any;
    `on_lost` gets the client that had control until now.
    """

    def __init__(self, notify: Callable[[Holder, Holder | None], None], on_lost: Callable[[Holder], None]) -> None:
        self._notify = notify
        self._on_lost = on_lost
        self._holder: Holder | None = None
        """The client that has control; None if it is free."""
        self._requester: Holder | None = None
        """The client that asks the holder for it."""
        self._expires_s = 0.0
        """When it gets control unless the holder uses it."""

    def is_held_by(self, client: Holder) -> bool:
        """Return whether this client has control."""
        return self._holder is client

    def join(self, client: Holder) -> None:
        """Add a client; it gets control if that is free and it has the token. No one is notified."""
        if self._holder is None and client.has_token:
            self._holder = client

    def leave(self, client: Holder) -> None:
        """Remove a client; control it had passes to the client that requested it."""
        if self._requester is client:
            self._requester = None
        if self._holder is client:
            self._pass_to(self._requester)

    def request(self, client: Holder, host_s: float) -> str | None:
        """Take control, or ask the holder for it; return why it is not taken yet.

        A holder that requests control itself declines the request of another client. One client asks at a time, and
        asking again does not begin its wait anew, so no sequence of requests keeps control from changing hands.
        """
        if self._holder is client:
            self._requester = None
            return None
        if self._holder is None:
            self._pass_to(client)
            return None
        if self._requester is not None and self._requester is not client:
            return f"{self._holder.name} has control, and {self._requester.name} has asked for it already"
        if self._requester is None:
            self._expires_s = host_s + REQUEST_TIMEOUT_S
            self._requester = client
        self._notify(self._holder, client)
        return (
            f"{self._holder.name} has control and was asked for it; "
            f"you get it in {max(0.0, self._expires_s - host_s):.0f} s unless it is used"
        )

    def release(self) -> None:
        """Pass control to the client that requested it; otherwise no client has it."""
        self._pass_to(self._requester)

    def grant(self, number: int) -> str | None:
        """Pass control to the client that requested it; return why not."""
        if self._requester is None or self._requester.number != number:
            return f"client {number} does not ask for control"
        self._pass_to(self._requester)
        return None

    def note_use(self, client: Holder, host_s: float) -> None:
        """Postpone a pending hand-over, because the holder used its control."""
        if self._holder is client:
            self._expires_s = host_s + REQUEST_TIMEOUT_S

    def expire(self, host_s: float) -> None:
        """Pass control to the client that requested it, if the holder left the request unanswered for too long."""
        if self._requester is not None and host_s >= self._expires_s:
            self._pass_to(self._requester)

    def _pass_to(self, client: Holder | None) -> None:
        """Give control to a client, or free it, and end the request; the one that loses it is reported first."""
        before, self._holder, self._requester = self._holder, client, None
        if before is not None and before is not client:
            self._on_lost(before)
            self._notify(before, None)
        if client is not None:
            self._notify(client, None)
