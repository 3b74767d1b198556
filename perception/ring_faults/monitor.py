"""Detection of a ring whose readings contradict its own motion: a ring that lies as a whole.

`perception.sensor_faults.monitor` finds single sensors that differ from their neighbours. What the whole ring says
can only be compared with how it moves. An honest ring among objects that stand still is compared with these:

- *Repeating.* Every sensor that looks ahead repeats its last reading to the bit, although the odometry brings it
  nearer to whatever answers, or winds. A wall along the path explains equal readings. A robot whose wheels slip looks
  the same, so the reason names both.
- *Replaying.* Readings change, but as others did before, to the bit (`perception.ring_faults.replays`).
- *Missing.* Readings do not depend on what is there: known echoes are silent all at once, or elsewhere, as random
  ranges are. How often an honest ring misses a known echo is learned on the way.
- *Turned.* The ranges change as they would on a ring that is mounted turned by 90°, 180° or 270°
  (`perception.ring_faults.mounting`, of a single sensor on a servo `perception.ring_faults.servo_mounting`).
  `EXCLUDED_NAT` of evidence exclude such a mounting until the odometry is reset; before, it limits the speed beside
  what would be ahead, and `DOUBTED_NAT` of evidence for it everywhere. A corridor does not tell a half turn.
- *Changed.* All readings change at once from one round of the firing pattern to the next, by a change that the
  sensors have in common (`perception.ring_faults.changes`).
- *Exchanged.* What a sensor hears is what others heard where another one looks, or behind it; or it hears nothing of
  it (`perception.ring_faults.wiring`).

All but the changes at once are sequential tests, with one threshold for all,
`perception.ring_faults.memory.EVIDENCE_NAT`. The same threshold names a single sensor that repeats its reading
while no wall along the path may answer it: a frozen ring may have heard a single echo.
A lie that agrees with the motion, as ranges that are all too long by the same amount do, can be found only as it
begins.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Final

import numpy as np

from config.robot import RingConfig
from drivers.messages import Firing
from perception.bounds import CONSTANT, COUNT, FINITE, PLACE, POSITIVE, bounds, index_of
from perception.kernel import Floats
from perception.records import records, zeros
from perception.ring_faults.changes import EXCHANGED, LENGTHENED, Expected
from perception.ring_faults.memory import EVIDENCE_NAT, QUARTERS, EchoTrace, RingTrace
from perception.ring_faults.motion_tests import (
    CHANGED,
    NOTHING,
    REPEATED,
    SCATTERED,
    STUCK_SENSOR,
    TURNED,
    VANISHED,
    check_motion,
)
from perception.ring_faults.mounting import DOUBTED_NAT, EXCLUDED_NAT, possible_places
from perception.ring_faults.replays import PAST_FIELDS, PAST_LOOKS, PastLooks
from perception.ring_faults.servo_mounting import LOOK_DIRECTIONS, DirectionTrace, forget_directions
from perception.ring_faults.wiring import LOOK_FIELDS, LOOKS, SENSORS_MAX, Wiring, weigh_turn, weigh_wiring
from perception.sensor_faults.monitor import TOLERANCE_MIN_M, TOLERANCE_STEPS
from perception.sensor_mounts import mounts_array, ring_pose, turn_mounts

_TURNED: Final = (
    "the ranges change as if the ring were mounted turned by {} against the robot file: check how it is mounted, "
    "its cables and the order of its sensors, then re-arm"
)
_ARM_TURNED: Final = (
    "the ranges change as if the sensor looked {} away from where its servo should turn it: check how its arm sits "
    "on the servo, and the servo's pulses, then re-arm"
)
_QUARTERS: Final = ("90°, counter-clockwise,", "180°", "90°, clockwise,")
_CHANGED: Final = (
    "the readings of the whole ring changed at once, as no motion changes them: {}; check the ring's power, cables "
    "and controller, and the odometry for a jump, then re-arm"
)
REASONS: Final = MappingProxyType(
    {
        REPEATED: "the ring repeats old readings although the odometry moves on: it is frozen, or the wheels turn "
        "and the robot does not move; check the ring's power and cables, and whether the wheels slip, then re-arm",
        VANISHED: "most echoes that the ring heard have vanished at once, and the robot has not moved past them: the "
        "ring hears nothing, or not all; check its power and cables and what covers it, then re-arm",
        SCATTERED: "the ring's readings are unrelated from one firing to the next: they do not come from what is "
        "there; check the ring for noise, crosstalk and loose cables, and the odometry for a jump, then re-arm",
        **{TURNED + k: _TURNED.format(turn) for k, turn in enumerate(_QUARTERS)},
        CHANGED + LENGTHENED: _CHANGED.format("all ranges are longer or shorter by the same length"),
        CHANGED + EXCHANGED: _CHANGED.format(
            "each sensor hears what another one heard, as if the ring had been turned"
        ),
    }
)
"""What happened, the likely cause, the next action."""
SERVO_REASONS: Final = MappingProxyType(
    {**REASONS, **{TURNED + k: _ARM_TURNED.format(turn) for k, turn in enumerate(_QUARTERS)}}
)
"""The same of a single sensor on a servo."""
WIRED: Final = CHANGED + EXCHANGED + 1
"""From here on, a finding is WIRED + i·n + j for sensors i and j of n that are exchanged; for i = j it looks
backwards, for i = n sensor j is deaf."""
WIRING_NAT: Final = EVIDENCE_NAT + math.log(0.5 * SENSORS_MAX**2)
"""Evidence that suffices for one of so many pairs, nat."""


TURN_NAT: Final = math.log(100.0)
"""Evidence of a whole turn in place that suffices, nat: there is one in a run, before its first drive. In 192 honest
turns of four rings, among mirrors and where everything echoes, none is accused; of 576 with one fault 568 are named
rightly, all 288 among them in rooms that were in view of no choice; two are named as another fault, six not."""


def deaf_reason(i: int) -> str:
    """Return why sensor `i` cannot hear."""
    return (
        f"sensor {i} heard nothing in a whole turn where the others heard echoes: it is deaf; check its 5 V, its "
        f"wires of trigger and echo (an echo of 5 V needs a divider to a board's 3.3 V, and without one the pin is "
        f"destroyed), and what covers it (`echolocate ring-test --hand` shows each), then re-arm"
    )


def wiring_reason(i: int, j: int) -> str:
    """Return why sensors `i` and `j` cannot be wired as the robot file says, or sensor `i` if they are the same."""
    if i == j:
        return (
            f"sensor {i} hears what the others hear on the opposite side: it looks backwards against the robot file; "
            f"turn it, or correct its angle_deg by 180 (`echolocate ring-test --hand` shows each), then re-arm"
        )
    return (
        f"sensors {i} and {j} each hear what the others hear where the other one looks: they are exchanged against "
        f"the robot file; exchange their cables, or their order in the file (`echolocate ring-test --hand` shows "
        f"each), then re-arm"
    )


class RingMonitor:
    """Compares the readings of the ring with its motion.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    """

    SCRATCH: Final = (
        "_echo_records",
        "_ring_records",
        "_turned",
        "_expected",
        "_past_looks",
        "_wiring",
        "_near",
        "_turn_nat",
        "_places",
        "_direction_records",
    )
    """Not part of a snapshot: views of arrays that are, or overwritten before each use."""
    BOUNDS: Final = bounds(
        _mounts=CONSTANT,
        _turning=CONSTANT,
        _turns=CONSTANT,
        _half_angle=CONSTANT,
        _tolerance=CONSTANT,
        _reach_m=CONSTANT,
        _may_be_turned=CONSTANT,
        _pivot=CONSTANT,
        _past=PLACE,
        _looks=COUNT,
        _replayed_nat=POSITIVE,
        _echoes=EchoTrace.BOUNDS,
        _ring=RingTrace.BOUNDS,
        _directions=DirectionTrace.BOUNDS,
        _turned_looks=PLACE,
        _turned_counts=COUNT,
        _exchanged_nat=FINITE,
        _found=index_of(WIRED + SENSORS_MAX * (SENSORS_MAX + 1)),
    )

    def __init__(self, ring: RingConfig) -> None:
        self._mounts = mounts_array(ring.mounts)
        self._turned = self._mounts.copy()
        self._turning = np.isin(np.arange(len(ring.mounts)), ring.turning)
        self._turns = bool(ring.turning)
        self._half_angle = math.radians(ring.beam_half_angle_deg)
        self._tolerance = max(TOLERANCE_STEPS * ring.resolution_m, TOLERANCE_MIN_M)
        self._reach_m = ring.window_m
        self._echoes = zeros(EchoTrace, len(ring.mounts))
        self._echo_records = records(EchoTrace, self._echoes)
        self._ring = zeros(RingTrace, 1)
        self._ring_records = records(RingTrace, self._ring)
        servo = ring.lone_servo
        self._may_be_turned = servo is not None or not ring.has_servo
        self._reasons = REASONS if servo is None else SERVO_REASONS
        self._pivot = np.zeros(2) if servo is None else np.array([servo.x_m, servo.y_m])
        self._directions = zeros(DirectionTrace, 0 if servo is None else LOOK_DIRECTIONS)
        self._direction_records = records(DirectionTrace, self._directions)
        forget_directions(self._direction_records)
        self._expected = records(Expected, zeros(Expected, len(ring.mounts)))
        self._past = np.zeros((len(ring.mounts), PAST_LOOKS, PAST_FIELDS))
        self._looks = np.zeros(len(ring.mounts), np.int64)
        self._replayed_nat = np.zeros(PAST_LOOKS)
        self._past_looks = PastLooks(self._past, self._looks, self._replayed_nat)
        is_tested = len(ring.mounts) <= SENSORS_MAX and not ring.turning
        wired = len(ring.mounts) if is_tested else 1  # the first sensor alone, with no other to compare it with
        self._turned_looks, self._turned_counts = np.zeros((wired, LOOKS, LOOK_FIELDS)), np.zeros(wired, np.int64)
        self._exchanged_nat = np.zeros((wired, wired))
        self._wiring = Wiring(self._turned_looks, self._turned_counts, self._exchanged_nat)
        self._near = np.zeros((wired * LOOKS, 3))
        self._turn_nat = np.zeros((wired, wired + 1))
        self._places = np.zeros((len(ring.mounts) * QUARTERS, 2))
        self._found = NOTHING

    def observe(self, firing: Firing) -> int | None:
        """Test a firing, in which sensors that are masked have no readings; return a sensor that is found stuck."""
        mounts = self._mounts
        if self._turns:
            mounts = self._turned
            turn_mounts(self._mounts, self._turning, float(firing.pose.theta - firing.ring_yaw), mounts)
        pose, reception = ring_pose(firing), (self._half_angle, self._tolerance, self._reach_m)
        found = check_motion(
            firing.ranges_m,
            pose,
            mounts,
            reception,
            self._echo_records,
            self._ring_records,
            self._expected,
            self._past_looks,
            self._direction_records,
        )
        wired = weigh_wiring(firing.ranges_m, pose, mounts, reception, self._wiring, self._near, WIRING_NAT)
        if wired >= 0 and self.judge_turn():  # all looks together know better which pair it is
            self._found = WIRED + int(wired)
        if found >= STUCK_SENSOR:
            return int(found) - STUCK_SENSOR
        if found != NOTHING:
            self._found = int(found)
        return None

    def judge_turn(self) -> bool:
        """Test the looks that are kept, those of a turn in place, as a whole; return whether all sensors agree."""
        n = len(self._exchanged_nat)
        if n < len(self._mounts):
            return True
        reception = (self._half_angle, self._tolerance, self._reach_m)
        weigh_turn(self._mounts, reception, self._wiring, self._near, self._turn_nat)
        deaf = self._turn_nat[:, n]  # before all others: one that hears anything is not
        best = int(np.argmax(self._turn_nat)) if deaf.max() < TURN_NAT else int(np.argmax(deaf)) * (n + 1) + n
        if self._turn_nat.flat[best] < TURN_NAT:
            return True
        i, j = divmod(best, n + 1)
        self._found = WIRED + (n * n + i if j == n else i * n + j)
        self._turned_counts[:] = 0
        return False

    def take_problem(self) -> str | None:
        """Return why the readings since the last call cannot be true, once; None if they can."""
        found, self._found = self._found, NOTHING
        if found >= WIRED:
            n = len(self._exchanged_nat)
            i, j = divmod(found - WIRED, n)
            return deaf_reason(j) if i == n else wiring_reason(i, j)
        return None if found == NOTHING else self._reasons[found]

    def possible_obstacles(self) -> Floats:
        """Return where the last echoes came from if the ring is turned, as far as that is not excluded: (k, 2), m.

        Of a servo among other sensors, or one that sweeps less than half a turn, the motion says too little: none.
        """
        if not self._may_be_turned:
            return self._places[:0]
        found = possible_places(self._mounts, self._pivot, self._echo_records, self._ring_records, self._places)
        return self._places[:found]

    @property
    def is_doubted(self) -> bool:
        """Whether a mounting that is not excluded explains the readings better than the robot file does."""
        ring = self._ring[0]
        return bool(((ring["excluded_nat"] < EXCLUDED_NAT) & (ring["turned_nat"] >= DOUBTED_NAT)).any())

    def set_reach(self, reach_m: float) -> None:
        """Expect echoes up to another range, m."""
        self._reach_m = reach_m

    def reset(self) -> None:
        """Start again after the odometry was reset."""
        self._echoes[...] = np.zeros((), self._echoes.dtype)
        self._ring[...] = np.zeros((), self._ring.dtype)
        self._directions[...] = np.zeros((), self._directions.dtype)
        forget_directions(self._direction_records)
        self._looks[:] = 0
        self._replayed_nat[:] = 0.0
        self._turned_counts[:] = 0
        self._exchanged_nat[:] = 0.0
        self._found = NOTHING
