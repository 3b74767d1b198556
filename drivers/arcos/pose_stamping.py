"""Odometry and firings from SIPs: each firing gets the pose at which it was fired, not that of its SIP."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from config.robot import RobotConfig
from drivers.arcos import diagnostics
from drivers.arcos.frames import Sip
from drivers.arcos.odometer import Odometer
from drivers.arcos.sip_clock import SipClock
from drivers.arcos.sonar import SonarRing
from drivers.arcos.wire_units import Polling
from drivers.dropped_count import LATE_FIRINGS, DroppedCount
from drivers.messages import Firing, Flags, Odometry, Pose
from drivers.odometry_history import OdometryHistory
from drivers.odometry_jumps import OdometryJumps
from drivers.token_bucket import TokenBucket

SIP_PERIOD_S: Final = 0.1
"""Time from one SIP to the next of a robot that does not report it, s."""
_HISTORY: Final = 64
"""SIPs kept to look up the pose of a firing, whose range comes with one of the next."""
_GAP_PERIODS: Final = 4.5
"""Longest gap between two SIPs to interpolate over, in their periods: three lost ones."""
_SIP_BYTES, _TAIL_BYTES, _READING_BYTES = 30, 11, 3
"""Length of a SIP with its frame, of the tail that newer firmware sends, and of one range."""
_BITS_PER_BYTE: Final = 10
_FIRINGS_SHARE, _FIRINGS_BURST = 4.0, 64.0
"""Firings passed on are at most so many times as frequent as those of the pattern, and so many at once."""
_EXCESS_NOTED: Final = 1000
"""Firings dropped from one note about it to the next."""
_NOTES_MAX: Final = 16
"""Notes kept if they are not taken."""


class PoseStamper:
    """Gives samples of the odometry their times, and firings their times and poses.

    The robot's clock is that of the run, from the first SIP after the robot's last known restart.

    Parameters
    ----------
    config
        The robot file.
    discs
        The robot's number of each sensor of the ring.

    Attributes
    ----------
    late_echoes
        Firings dropped because their pose is not known.
    excess_echoes
        Firings dropped because the robot sends many more than its pattern has.
    """

    def __init__(self, config: RobotConfig, discs: tuple[int, ...]) -> None:
        self.late_echoes = DroppedCount(LATE_FIRINGS, self.note)
        self.excess_echoes = 0
        self._odometer = Odometer(config.arcos)
        self._jumps = OdometryJumps(config.body)
        self._history = OdometryHistory(_HISTORY)
        self._sonar = SonarRing(discs, config.arcos.range_factor)
        self._clock = SipClock(SIP_PERIOD_S)
        self._firing_limit = TokenBucket(math.inf, math.inf)
        self._epoch_s: float | None = None
        self._is_set_to_zero = False
        self._notes: deque[str] = deque(maxlen=_NOTES_MAX)

    @property
    def origin(self) -> Pose:
        """The origin of the poses passed on, in the robot's own odometry; the identity until that jumps."""
        return self._jumps.origin

    def note(self, text: str) -> None:
        """Add a message for the operator."""
        self._notes.append(text)

    def notes(self) -> tuple[str, ...]:
        """Return the messages for the operator, and remove them."""
        notes = tuple(self._notes)
        self._notes.clear()
        return notes

    def set_polling(self, polling: Polling) -> None:
        """Set the firing pattern that the robot carries out."""
        cycle_s = 1e-3 * polling.cycle_ms
        self._sonar.set_cycle(cycle_s, polling.window_m)
        self._firing_limit = TokenBucket(_FIRINGS_SHARE / cycle_s, _FIRINGS_BURST)

    def set_period(self, period_s: float) -> None:
        """Set the time from one SIP to the next."""
        self._clock = SipClock(period_s)

    def break_off(self) -> None:
        """Discard times and poses: later SIPs do not continue the earlier ones."""
        self._clock.restart()
        self._sonar.restart()
        self._history.clear()

    def begin_session(self, sip: Sip, *, was_reset: bool, was_lost: bool) -> bool:
        """Prepare for the first SIP of a session, and return whether the robot has restarted.

        Parameters
        ----------
        sip
            The packet.
        was_reset
            Whether the controller said that it was reset.
        was_lost
            Whether the robot was no longer in the session of before when it was called.
        """
        is_first, was_at_zero = self._epoch_s is None, self._odometer.is_at_zero
        is_set_to_zero = not was_at_zero and Odometer.is_near_zero(sip)
        if is_first or not (was_reset or (was_lost and is_set_to_zero)):
            # Some firmware sets the odometry to zero for a new session.
            self._is_set_to_zero = is_set_to_zero
            return False
        self._odometer.restart()
        self._jumps.restart()
        self.break_off()
        self._epoch_s = None
        return True

    def sip(
        self, sip: Sip, arrived_s: float, flags: Flags, baud: int | None = None, *, after_loss: bool
    ) -> tuple[Odometry, list[Firing]]:
        """Return the sample of a SIP and the firings whose ranges it lists.

        Parameters
        ----------
        sip
            The packet.
        arrived_s
            Its arrival by the run's clock.
        flags
            The base's status.
        baud
            The line's speed, which delays it; None on a line without one.
        after_loss
            Whether a corrupt frame came since the SIP before.
        """
        if baud is not None:
            length = _SIP_BYTES + _TAIL_BYTES * (sip.charge is not None) + _READING_BYTES * len(sip.sonar)
            arrived_s -= length * _BITS_PER_BYTE / baud
        measured_s = self._clock.read(arrived_s, after_loss=after_loss)
        if self._epoch_s is None:
            self._epoch_s = measured_s
        reported = self._odometer.read(sip, measured_s - self._epoch_s, flags)
        if self._is_set_to_zero:
            self._is_set_to_zero = False
            self._jumps.rebase(reported)
            self.note(diagnostics.ODOMETRY_AT_ZERO)
        sample, note = self._jumps.remove(reported)
        if note is not None:
            self.note(note)
        self._history.add(sample)
        return sample, self._firings(sip, sample.robot_s, arrived_s)

    def _firings(self, sip: Sip, sip_s: float, arrived_s: float) -> list[Firing]:
        firings, period_s = [], self._clock.period_s
        for fired_s, ranges in self._sonar.firings(sip.sonar, sip_s, period_s):
            place = self._history.at(fired_s, _GAP_PERIODS * period_s)
            if place is None:
                self.late_echoes.add()
            elif not self._firing_limit.take(arrived_s):
                self.excess_echoes += 1
                if self.excess_echoes % _EXCESS_NOTED == 1:
                    self.note(diagnostics.EXCESS_FIRINGS)
            else:
                firings.append(Firing(fired_s, *place, ranges))
        return firings
