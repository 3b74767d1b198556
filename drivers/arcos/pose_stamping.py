"""Odometry and firings from SIPs: each firing gets the pose at which it was fired, not that of its SIP."""

from __future__ import annotations

from typing import Final

from config.robot import RobotConfig
from drivers.arcos import diagnostics
from drivers.arcos.frames import Sip
from drivers.arcos.odometer import Odometer
from drivers.arcos.sip_clock import SipClock
from drivers.arcos.sonar import SonarRing
from drivers.arcos.wire_units import Polling
from drivers.messages import Firing, Flags, Odometry
from drivers.odometry_history import OdometryHistory
from drivers.stamper import Stamper

SIP_PERIOD_S: Final = 0.1
"""Time from one SIP to the next of a robot that does not report it, s."""
_HISTORY: Final = 64
"""SIPs kept to look up the pose of a firing, whose range comes with one of the next."""
_GAP_PERIODS: Final = 4.5
"""Longest gap between two SIPs to interpolate over, in their periods: three lost ones."""
_SIP_BYTES: Final = 30
"""Length of a SIP with its frame, without ranges."""
_TAIL_BYTES: Final = 11
"""Length of the tail that newer firmware sends."""
_READING_BYTES: Final = 3
"""Length of one range."""
_BITS_PER_BYTE: Final = 10


class PoseStamper(Stamper):
    """Gives samples of the odometry their times, and firings their times and poses.

    The robot's clock is that of the run, from the first SIP after the robot's last known restart.

    `discs` are the robot's numbers of the ring's sensors.
    """

    def __init__(self, config: RobotConfig, discs: tuple[int, ...]) -> None:
        super().__init__(config.body)
        self._odometer = Odometer(config.arcos)
        self._history = OdometryHistory(_HISTORY)
        self._sonar = SonarRing(discs, config.arcos.range_factor)
        self._clock = SipClock(SIP_PERIOD_S)
        self._epoch_s: float | None = None
        """The run's time when the robot's clock was zero; None before the first SIP after a restart."""
        self._is_set_to_zero = False
        """Whether the robot set its odometry to zero for this session, whose first sample is still to come."""

    def set_polling(self, polling: Polling) -> None:
        """Set the firing pattern that the robot carries out."""
        cycle_s = 1e-3 * polling.cycle_ms
        self._sonar.set_cycle(cycle_s, polling.window_m)
        self._limit_firings(cycle_s)

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

        `was_reset`: the controller said so. `was_lost`: the robot was no longer in the session of before when it was
        called.
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

        It arrived at `arrived_s` by the run's clock, delayed by the line's speed `baud`; None on a line without one.
        `after_loss`: a corrupt frame came since the SIP before.
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
        sample = self._without_jump(reported)
        self._history.add(sample)
        return sample, self._firings(sip, sample.robot_s, arrived_s)

    def _firings(self, sip: Sip, sip_s: float, arrived_s: float) -> list[Firing]:
        """Return the firings whose ranges a SIP lists, without those of unknown pose and those beyond the limit.

        `sip_s` is the SIP's time by the robot's clock, `arrived_s` by the run's.
        """
        firings, period_s = [], self._clock.period_s
        for fired_s, ranges in self._sonar.firings(sip.sonar, sip_s, period_s):
            place = self._history.at(fired_s, _GAP_PERIODS * period_s)
            if place is None:
                self.late_echoes.add()
            elif not self._is_excess(arrived_s):
                firings.append(Firing(fired_s, *place, ranges))
        return firings
