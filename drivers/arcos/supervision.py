"""Supervision of a robot that acknowledges nothing: whether it stops, starts, receives, and has the file's sonars."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Final

from drivers.arcos.commands import Command, CommandNumber
from drivers.arcos.frames import Sip, SipFlags
from drivers.arcos.handshake import STOP

_REPEAT_S: Final = 0.1
"""Time from one stop to the next until the base stands, s."""
_MOTORS_OFF_S: Final = 1.0
"""Time after which the motors of a base that does not stand are switched off in motion, s."""
_REQUEST_S: Final = 0.25
"""Time from one request for an answer to the next, s."""
_ENABLE_S: Final = 0.3
"""Time until motors that were switched on are reported so, s: two or three SIPs."""
_SEEN_S: Final = 0.15
"""Time after which a SIP reports what a command did, s: more than a period."""
_UNSUPPORTED: Final = 8
"""Requests without any answer after which a robot counts as one that does not know them."""
_STRANGE_SIPS: Final = 5
"""So many SIPs in a row with sonars, and none that the robot file lists, are no rest of an earlier sequence."""


class Halting:
    """Stops the base again and again until it stands with its motors off.

    Switched off in motion, motors may let the base roll; so they are switched off when it stands, or when it does not
    obey for long. Until they are off, a velocity that was sent before the stop could still take effect.
    """

    def __init__(self) -> None:
        self.is_active = False
        """Whether the base has yet to stand with its motors off."""
        self._began_s: float | None = None
        """When the first stop of this halt was sent; None before."""
        self._sent_s: float | None = None
        """When the last one was sent; None before, −inf if the next is due at once."""
        self._has_stood = False
        """Whether the last SIP after a stop reported a base that stands."""

    def start(self) -> None:
        """Stop the base at once."""
        if not self.is_active:
            self.is_active, self._began_s = True, None
        self._sent_s, self._has_stood = None, False

    def cancel(self) -> None:
        """End: the motors are to be switched on."""
        self.is_active = False

    def observe(self, sip: Sip) -> None:
        """Take what the robot reports; before a stop has been sent it says nothing about it."""
        if self.is_active and self._sent_s is not None:
            had_stood, self._has_stood = self._has_stood, sip.left == sip.right == 0
            self.is_active = not self._has_stood or bool(sip.flags & SipFlags.MOTORS_ENABLED)
            if self._has_stood and not had_stood:
                self._sent_s = -math.inf  # the motors go off at once

    def commands(self, run_s: float) -> tuple[Command, ...]:
        """Return the commands to send now, and consider them sent; none until `_REPEAT_S` after the last."""
        if not self.is_active or (self._sent_s is not None and run_s - self._sent_s < _REPEAT_S):
            return ()
        self._sent_s = run_s
        if self._began_s is None:
            self._began_s = run_s
        if self._has_stood or run_s - self._began_s >= _MOTORS_OFF_S:
            return *STOP, Command(CommandNumber.ENABLE, 0)
        return STOP

    def moving_s(self, run_s: float) -> float:
        """Return how long after the first stop the base still moves, s; 0 if it stands or none was sent."""
        return run_s - self._began_s if self.is_active and self._began_s is not None and not self._has_stood else 0.0


class Enabling:
    """Switches the motors on when they are released, and only then.

    Attributes
    ----------
    are_on
        Whether the last SIP reported the motors as on.
    is_waiting
        Whether they were switched on and are not yet reported so.
    """

    def __init__(self) -> None:
        self.are_on = self.is_waiting = False
        self._is_released = False
        self._tries, self._sent_s = 0, 0.0
        """How often they were switched on since the release, and when last."""

    @property
    def may_drive(self) -> bool:
        """Whether the motors are released and on."""
        return self._is_released and self.are_on and not self.is_waiting

    @property
    def tries(self) -> int:
        """How often they were switched on without effect."""
        return self._tries if self.is_waiting else 0

    def release(self) -> None:
        """Switch the motors on, also if they seem to be: they may be about to go off."""
        self._is_released, self.is_waiting, self._tries = True, True, 0

    def withdraw(self) -> None:
        """End the release: the motors are no longer switched on, nor the base driven."""
        self._is_released = self.is_waiting = False

    def observe(self, status: SipFlags, run_s: float) -> None:
        """Take what the robot reports; whatever switches motors off, only a release switches them on again."""
        self.are_on = bool(status & SipFlags.MOTORS_ENABLED)
        if self.is_waiting:
            # Before that, it may report what was before the command.
            self.is_waiting = not self.are_on or self._tries == 0 or run_s - self._sent_s < _SEEN_S
        elif not self.are_on:
            self.withdraw()

    def commands(self, run_s: float) -> tuple[Command, ...]:
        """Return the command to switch them on if it is due, and consider it sent."""
        if not self.is_waiting or (self._tries > 0 and run_s - self._sent_s < _ENABLE_S):
            return ()
        self._tries, self._sent_s = self._tries + 1, run_s
        return (Command(CommandNumber.ENABLE, 1),)


class ReceiverMonitor:
    """Requests the wheels' encoders now and then: a robot that does not answer any more no longer receives.

    A robot that has never answered does not know the request, and is not supervised.
    """

    def __init__(self) -> None:
        self._is_supported = False
        """Whether the robot has ever answered."""
        self._unanswered = 0
        """Requests since the last answer."""
        self._first_s = 0.0
        """When the first of these was sent."""
        self._sent_s: float | None = None
        """When the last request was sent; None before."""

    def answered(self) -> None:
        """Take an answer."""
        self._is_supported = True
        self._unanswered = 0

    def commands(self, run_s: float) -> tuple[Command, ...]:
        """Return the request if it is due, and consider it sent."""
        if not self._is_supported and self._unanswered >= _UNSUPPORTED:
            return ()
        if self._sent_s is not None and run_s - self._sent_s < _REQUEST_S:
            return ()
        self._sent_s = run_s
        if self._unanswered == 0:
            self._first_s = run_s
        self._unanswered += 1
        return (Command(CommandNumber.ENCODER, 1),)

    def unanswered_s(self, run_s: float) -> float:
        """Return how long ago the first request was sent that is not answered; 0 if all are."""
        return run_s - self._first_s if self._is_supported and self._unanswered > 0 else 0.0


class DiscMonitor:
    """Watches for a robot that measures sonars and none of those that its file lists.

    The first SIPs of a session are of the robot's own sequence, which may begin with others.
    """

    def __init__(self, discs: Collection[int]) -> None:
        self._discs = frozenset(discs)
        self._strange = 0
        """SIPs in a row with sonars and no listed one."""

    @property
    def are_others(self) -> bool:
        """Whether only others have been reported for long."""
        return self._strange >= _STRANGE_SIPS

    def observe(self, sip: Sip, *, is_set_up: bool) -> None:
        """Take a SIP; one without sonars says nothing, and one before the end of the set-up begins anew."""
        if not is_set_up:
            self._strange = 0
        elif sip.sonar:
            are_others = self._discs.isdisjoint(one.number for one in sip.sonar)
            self._strange = self._strange + 1 if are_others else 0
