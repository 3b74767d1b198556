"""The ring with the faults of its sensors: what it reports in place of what its sonars hear."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.emulator.fault_schedule import FaultSchedule
from drivers.emulator.faults import (
    BlindNear,
    CoarseRanges,
    ConstantRing,
    DelayedEchoes,
    DroppedReadings,
    Fault,
    FrozenRing,
    Outliers,
    RangeOffset,
    ReplayedEchoes,
    ReportedSilence,
    SilentRing,
    StuckSensor,
    SwappedSensors,
    TurnedRing,
)
from drivers.emulator.sonar import Sonar
from drivers.messages import Floats, Pose

KINDS: tuple[type[Fault], ...] = (
    BlindNear,
    CoarseRanges,
    ConstantRing,
    DelayedEchoes,
    DroppedReadings,
    FrozenRing,
    Outliers,
    RangeOffset,
    ReplayedEchoes,
    ReportedSilence,
    SilentRing,
    StuckSensor,
    SwappedSensors,
    TurnedRing,
)
"""The faults of sensors."""
Memory: TypeAlias = FrozenRing | ReplayedEchoes | DelayedEchoes
"""The faults by which sensors report what they heard before."""


class FaultySonar:
    """A ring of any family; its faults act in the order of the signal: mounts, echoes, electronics, cables.

    Parameters
    ----------
    sonar
        What the sensors hear.
    sensors
        How many there are.
    faults
        What is wrong with the robot at present.
    rng
        Random numbers of the faults.
    """

    def __init__(self, sonar: Sonar, sensors: int, faults: FaultSchedule, rng: np.random.Generator) -> None:
        self._sonar, self._sensors, self._faults, self._rng = sonar, sensors, faults, rng
        self._heard = [deque[tuple[int, float]]() for _ in range(sensors)]
        remembering: list[Memory] = [*faults.planned(ReplayedEchoes), *faults.planned(DelayedEchoes)]
        self._kept_us = max((_kept_us(fault) for fault in remembering), default=0)
        self._fired = np.zeros(sensors, np.int64)

    def fire(
        self,
        at_us: int,
        pose: Pose,
        ring_yaw: float,
        fired: Sequence[int],
        window_m: float,
        listeners: Sequence[int] = (),
    ) -> list[float | None]:
        """Return what the sensors that fire at a time, and then those that listen, report.

        Parameters
        ----------
        at_us
            Time since the emulator's start, µs.
        pose, ring_yaw, window_m, listeners
            As of `Sonar.fire`.
        fired
            Numbers of the sensors that fire.

        Returns
        -------
        list
            Ranges in m, +inf for silence, None for a sensor that reports a fault.
        """
        faults = self._faults
        wired, active = self._wiring(), (*fired, *listeners)
        turned = math.radians(sum(fault.angle_deg for fault in faults.all(TurnedRing) if not fault.sensors))
        self._sonar.turn_each(self._turns())
        mounted = Pose(pose.x, pose.y, pose.theta + turned) if turned else pose
        ranges = self._sonar.fire(
            mounted, ring_yaw + turned, [wired[i] for i in fired], window_m, [wired[i] for i in listeners]
        )[wired]
        for offset in faults.all(RangeOffset):
            which = self._those(offset.sensors)
            ranges[which] = np.maximum(ranges[which] + offset.offset_m, 0.0)
            ranges[ranges > window_m] = math.inf
        for blind in faults.all(BlindNear):
            ranges[self._those(blind.sensors) & (ranges < blind.range_m)] = math.inf
        self._repeat(ranges, active, at_us)
        for outliers in faults.all(Outliers):
            wild = self._rng.random(len(ranges)) < outliers.share
            ranges[wild] = self._rng.uniform(0.0, window_m, len(ranges))[wild]
        for constant in faults.all(ConstantRing):
            ranges[self._those(constant.sensors)] = constant.range_m
        self._fired[list(active)] += 1
        for silent in faults.all(SilentRing):
            ranges[self._those(silent.sensors) & (self._fired % silent.every == 0)] = math.inf
        for reported in faults.all(ReportedSilence):
            # A greatest range also stands for what a longer window hears farther away.
            is_silent = np.isinf(ranges) | ((ranges > reported.range_m) & (reported.range_m > 0.0))
            ranges[self._those(reported.sensors) & is_silent] = reported.range_m
        for coarse in faults.all(CoarseRanges):
            which = self._those(coarse.sensors)
            ranges[which] = coarse.step_m * np.round(ranges[which] / coarse.step_m)
        missing: set[int] = set()
        for dropped in faults.all(DroppedReadings):
            which = self._those(dropped.sensors) & (self._rng.random(len(ranges)) < dropped.share)
            if dropped.silent:
                ranges[which] = math.inf
            else:
                missing.update(which.nonzero()[0].tolist())
        stuck = {fault.sensor: fault.range_m for fault in faults.all(StuckSensor)}
        return [stuck[i] if i in stuck else None if i in missing else float(ranges[i]) for i in active]

    def _wiring(self) -> NDArray[np.int64]:
        """Return which sensor answers in each one's place."""
        wired = np.arange(self._sensors)
        for swap in self._faults.all(SwappedSensors):
            if max(swap.first, swap.second) < self._sensors:
                wired[[swap.first, swap.second]] = wired[[swap.second, swap.first]]
        return wired

    def _turns(self) -> dict[int, float]:
        """Return by how much each sensor that is turned by itself is, rad."""
        turned = [fault for fault in self._faults.all(TurnedRing) if fault.sensors]
        return {i: math.radians(fault.angle_deg) for fault in turned for i in fault.sensors if i < self._sensors}

    def _those(self, sensors: Iterable[int]) -> NDArray[np.bool_]:
        """Return a mask of these sensors, of all if there is none."""
        chosen = [i for i in sensors if i < self._sensors]
        which = np.full(self._sensors, not tuple(sensors))
        which[chosen] = True
        return which

    def _repeat(self, ranges: Floats, active: Sequence[int], at_us: int) -> None:
        """Put earlier ranges in the place of the present ones where a fault says so; otherwise keep the present."""
        faults: list[Memory] = [*self._faults.all(FrozenRing), *self._faults.all(ReplayedEchoes)]
        faults += self._faults.all(DelayedEchoes)
        repeated = {i: fault for fault in faults for i in self._those(fault.sensors).nonzero()[0].tolist()}
        for i in active:
            heard, fault = self._heard[i], repeated.get(i)
            if not isinstance(fault, FrozenRing | ReplayedEchoes) or not heard:
                heard.append((at_us, float(ranges[i])))
                while len(heard) > 1 and heard[1][0] <= at_us - self._kept_us:
                    heard.popleft()
            if fault is not None:
                ranges[i] = _range_then(heard, fault, at_us)
                if isinstance(fault, FrozenRing) and fault.jitter_m > 0.0:
                    ranges[i] = max(0.0, ranges[i] + self._rng.uniform(-fault.jitter_m, fault.jitter_m))


def _kept_us(fault: Memory) -> int:
    """Return for how long a fault remembers what was heard, µs."""
    match fault:
        case ReplayedEchoes():
            return round(1e6 * fault.period_s)
        case DelayedEchoes():
            return round(1e6 * fault.delay_s)
        case _:
            return 0


def _range_then(heard: Iterable[tuple[int, float]], fault: Memory, at_us: int) -> float:
    """Return the range that a sensor repeats at a time: the last one, that of the period, or a late one."""
    begin_us, kept_us = round(1e6 * fault.at_s), _kept_us(fault)
    then_us = begin_us
    if isinstance(fault, ReplayedEchoes):
        then_us += (at_us - begin_us) % kept_us - kept_us
    elif isinstance(fault, DelayedEchoes):
        then_us = at_us - kept_us
    return [range_m for i, (t_us, range_m) in enumerate(heard) if i == 0 or t_us <= then_us][-1]
