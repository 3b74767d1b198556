"""Drives of robots that lie: whether one touches anything at speed, and how soon the lie is named.

Each trial is a drive in virtual time through a room, the protocol included. At a random moment a lie begins; from
then on the drive lasts until the robot stops by itself, at most for `LIE_S`. What the robot touches, and how fast, is
the emulator's truth and not what the robot reports. A lie is named by a stop with a reason, by a sensor that is
reported, by a note of the driver, by the line that nothing is heard, or by the reason why the robot drives slowly.
A turned ring is named by a stop, or where the robot drives slowly as the ring seems turned, and by nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from types import MappingProxyType
from typing import Any, Final, TypeAlias

import numpy as np
from pydantic import TypeAdapter
from rich.table import Table

from bench.trials.room_drives import drive_settings, make_drive
from config.settings import Settings
from drivers.emulator.faults import Fault
from drivers.emulator.memory_transport import MemoryLine
from drivers.registry import make_device, make_driver
from runtime.cycle.drive_requests import first_request, needs_recognition
from runtime.cycle.echo_watch import NOTHING_NEW, NOTHING_SO_FAR, NOTHING_YET
from runtime.cycle.inputs import OperatorInput, Request, gather_inputs
from runtime.cycle.modes import Mode
from runtime.cycle.mounting_limit import ARM_DOUBTED, DOUBTED
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import apply_command, step
from runtime.cycle.unheard_limit import LOST, REMEMBERED, UNHEARD
from runtime.timing.refinement_budget import QUANTA_PER_CYCLE, QuantumBudget

ROBOTS: Final = (
    "amigo", "atrvjr", "b21r", "b21r-base", "b21r-both", "denning", "ears", "hobby3", "hobby8", "magellan", "p3at",
    "p3dx", "p3dx-sh", "parking12", "peoplebot", "powerbot", "servo1",
)  # fmt: skip
AHEAD, ALL_BUT_ONE, ONE = "ahead", "all but one", "one"
"""In place of the numbers of sensors: those within 60° of the robot's front; all but one ahead; that one."""
KINDS: Final[Mapping[str, Mapping[str, Any]]] = MappingProxyType({
    "frozen": {"kind": "frozen_ring"}, "frozen ahead": {"kind": "frozen_ring", "sensors": AHEAD},
    "frozen but one": {"kind": "frozen_ring", "sensors": ALL_BUT_ONE},
    "frozen with jitter": {"kind": "frozen_ring", "jitter_m": 0.001},
    "silent ahead": {"kind": "silent_ring", "sensors": AHEAD},
    "alternately silent": {"kind": "silent_ring", "every": 2}, "delayed": {"kind": "delayed_echoes"},
    "coarse": {"kind": "coarse_ranges"}, "odometry frozen": {"kind": "odometry_error"},
    "odometry backwards": {"kind": "odometry_error", "factor": -1.0},
    "turned 45": {"kind": "turned_ring", "angle_deg": 45.0}, "latched clock": {"kind": "clock_error"},
    "silent": {"kind": "silent_ring"}, "at the maximum": {"kind": "constant_ring", "range_m": math.inf},
    "blind near": {"kind": "blind_near"}, "constant": {"kind": "constant_ring"},
    "constant at .5 m": {"kind": "constant_ring", "range_m": 0.5}, "dropped": {"kind": "dropped_readings"},
    "dropped silent": {"kind": "dropped_readings", "silent": True},
    "random": {"kind": "outliers", "share": 1.0}, "turned 90": {"kind": "turned_ring"},
    "turned 180": {"kind": "turned_ring", "angle_deg": 180.0},
    "exchanged": {"kind": "swapped_sensors", "first": 0, "second": 2},
    "long 1.5 ft": {"kind": "range_offset"}, "long 4 ft": {"kind": "range_offset", "offset_m": 1.2192},
    "short 1.5 ft": {"kind": "range_offset", "offset_m": -0.4572}, "replayed": {"kind": "replayed_echoes"},
    "clock at half": {"kind": "clock_error", "rate": 0.5},
    "clock at double": {"kind": "clock_error", "rate": 2.0},
    "clock in steps": {"kind": "clock_error", "rate": 1.0, "step_s": 0.2},
    "clock leaps": {"kind": "clock_error", "rate": 1.0, "leap_s": 0.6},
    "clock leaps back": {"kind": "clock_error", "rate": 1.0, "leap_s": -0.6},
    "object at .1 m": {"kind": "sudden_object", "distance_m": 0.1},
    "object at .3 m": {"kind": "sudden_object", "distance_m": 0.3},
})  # fmt: skip
"""The kinds of lies; `constant_ring` of +inf stands for the ring's greatest range."""
_DEAF, _CONSTANT = {"kind": "silent_ring"}, {"kind": "constant_ring"}
BUILT: Final[Mapping[str, Mapping[str, Any]]] = MappingProxyType({
    "one deaf": {**_DEAF, "sensors": ONE}, "one at 1 m": {**_CONSTANT, "sensors": ONE, "range_m": 1.0},
    "one too short": {**_CONSTANT, "sensors": ONE, "range_m": 0.0017}, "all deaf": _DEAF,
    "one at its maximum": {**_CONSTANT, "sensors": ONE, "range_m": math.inf},
    "one backwards": {"kind": "turned_ring", "sensors": ONE, "angle_deg": 180.0},
    "two exchanged": KINDS["exchanged"], "all too short": {**_CONSTANT, "range_m": 0.0017},
    "silence as 0": {"kind": "reported_silence"},
    "silence as maximum": {"kind": "reported_silence", "range_m": math.inf},
})  # fmt: skip
"""Faults that a robot is built with: they are there from the start."""
CLOCK, OF_TWO = "clock", ("exchanged", "but one")
"""Kinds with these words change nothing on a robot whose packets carry no stamps, and on one with one sensor."""
HELD: Final = frozenset({LOST, NOTHING_NEW, NOTHING_SO_FAR, NOTHING_YET, REMEMBERED, UNHEARD})
"""Reasons to hold that name a lie, but for a turned ring: that has its own."""
AHEAD_DEG: Final = 60.0
MOVED_M: Final = 0.5
"""A robot that has driven less since a lie began has hardly changed what it hears."""
AT_SPEED_M_S: Final = 0.05
"""A slower contact is none that counts."""
FROM_S, UNTIL_S = 3.0, 25.0
"""When a lie begins, after the robot was armed."""
LIE_S: Final = 20.0
"""How long it lasts at most."""
HONEST_S: Final = 120.0
"""How long an honest drive lasts at most."""
BUMPER: Final = "bumper contact"
"""A stop with this reason names no lie."""


Plan: TypeAlias = tuple[str, str, str | None, int, int]
"""Robot, room, kind, seed and moment of a trial."""


@dataclass(frozen=True, slots=True)
class TrialResult:
    """What became of one drive.

    Attributes
    ----------
    robot, room, kind
        As in the options of the command; kind None is an honest drive.
    seed, moment
        Of the drive, and number of its moment.
    began_s
        When the lie began.
    speed_m_s
        The robot's true speed at that moment.
    contact_m_s
        The greatest speed of a contact after it; 0 without one.
    contact_s, named_s
        When that came, and when the lie was named, from its beginning; None if never.
    said
        The reason, report or note that names it; of an honest drive, the reason of its stop.
    drive_s
        How long the drive lasted.
    way_m
        How far the robot truly drove after the lie began, or in an honest drive.
    """

    robot: str
    room: str
    kind: str | None
    seed: int
    moment: int
    began_s: float
    speed_m_s: float
    contact_m_s: float
    contact_s: float | None
    named_s: float | None
    said: str | None
    drive_s: float
    way_m: float

    @property
    def is_driving(self) -> bool:
        """Whether it drove far enough for its motion to contradict a lie."""
        return self.way_m > MOVED_M

    @property
    def is_contact(self) -> bool:
        """Whether it touched something at speed."""
        return self.contact_m_s > AT_SPEED_M_S


def make_lie(kind: str, settings: Settings, begin_s: float) -> Fault:
    """Return the fault of a kind of lie that begins then and does not end."""
    values: dict[str, Any] = dict(BUILT[kind] if kind in BUILT else KINDS[kind])
    if values.get("range_m") == math.inf:
        values["range_m"] = settings.ring.range_max_m
    axes = [abs(math.degrees(math.remainder(mount.angle_rad, math.tau))) for mount in settings.ring.mounts]
    if values.get("sensors") == AHEAD:
        values["sensors"] = [i for i, angle_deg in enumerate(axes) if angle_deg <= AHEAD_DEG]
    elif values.get("sensors") in {ONE, ALL_BUT_ONE}:
        of, is_one = settings.ring.sensor_of, values["sensors"] == ONE  # one on a servo has a number for each bearing
        values["sensors"] = [i for i, sensor in enumerate(of) if (sensor == of[int(np.argmin(axes))]) is is_one]
    adapter: TypeAdapter[Fault] = TypeAdapter(Fault)
    return adapter.validate_python(values | {"at_s": begin_s, "duration_s": 1e4})


def run_trial(
    robot: str,
    room: str,
    kind: str | None,
    seed: int,
    moment: int,
    *,
    recognises: bool = False,
) -> TrialResult:
    """Return the result of one drive.

    Parameters
    ----------
    robot, room, kind, seed, moment
        As in `TrialResult`.
    recognises
        Whether recognition runs also where the drive does not wait for it; it takes most of the time.
    """
    drive = make_drive(robot, room, seed)
    settings = drive.settings
    rng = np.random.default_rng([seed, moment, 41])
    begin_s = 0.0 if kind is None or kind in BUILT else float(rng.uniform(FROM_S, UNTIL_S))
    faults = () if kind is None else (make_lie(kind, settings, begin_s),)
    device, driver = make_device(settings, drive.world, 1000 * seed + moment, faults=faults), make_driver(settings)
    line = MemoryLine(driver, device)
    recognises = recognises or needs_recognition(first_request(settings))
    state = fresh_state(settings, recognises=recognises)
    budget, cycle = QuantumBudget(QUANTA_PER_CYCLE), 0
    until_s = begin_s + (HONEST_S if kind is None else LIE_S)
    is_turned = (kind or "").startswith("turned") or (kind == "one backwards" and settings.ring.has_servo)
    names = frozenset[str]() if kind is None else frozenset({ARM_DOUBTED, DOUBTED}) if is_turned else HELD
    run_s = before_m_s = speed_m_s = contact_m_s = way_m = 0.0
    place = device.truth.pose
    contact_s = named_s = said = held = None
    known: set[object] = set()
    while run_s < until_s:
        cycle += 1
        run_s = cycle / settings.cycle.rate_hz
        line.exchange(run_s)
        operator = OperatorInput(Request.ARM if state.mode.mode is Mode.READY else None)
        inputs = gather_inputs(driver, run_s, operator, preparing=None if recognises else "left out")
        budget.begin()
        step(state, inputs, settings, lambda command: apply_command(driver, command), budget)
        truth, before = device.truth, place
        place = truth.pose
        reports = {(report.sensor, report.fault): report.reason for report in state.perception.sensor_reports()}
        if run_s < begin_s:
            known |= set(reports) | set(inputs.received.notes) | {state.echo_watch.silence}
            held = state.hold_reason
            before_m_s, speed_m_s = truth.contact_m_s, abs(truth.twist.v)
            continue
        way_m += math.hypot(place.x - before.x, place.y - before.y)
        if contact_s is None and truth.contact_m_s > max(before_m_s, AT_SPEED_M_S):
            contact_m_s, contact_s = truth.contact_m_s, run_s - begin_s
        if named_s is None:
            texts = []
            if kind is not None and not is_turned:  # nothing else says that a ring is turned, but a stop
                texts += [text for key, text in reports.items() if key not in known]
                texts += [note for note in inputs.received.notes if note not in known]
                texts += [line for line in [state.echo_watch.silence] if line is not None and line not in known]
            if state.mode.mode in {Mode.SAFE_STOP, Mode.FAULT} and not str(state.mode.reason).startswith(BUMPER):
                texts.append(str(state.mode.reason))
            held = held if state.hold_reason == held else None
            if held is None and state.hold_reason in names:
                texts.append(str(state.hold_reason))
            if texts:
                named_s, said = run_s - begin_s, texts[-1]
        if contact_s is not None or state.mode.mode in {Mode.SAFE_STOP, Mode.FAULT}:
            until_s = min(until_s, run_s + 1.0)
    return TrialResult(
        robot,
        room,
        kind,
        seed,
        moment,
        begin_s,
        speed_m_s,
        contact_m_s,
        contact_s,
        named_s,
        said,
        run_s,
        way_m,
    )


def trials(
    robots: Sequence[str], rooms: Sequence[str], kinds: Sequence[str], seeds: Iterable[int], moments: int
) -> Iterator[Plan]:
    """Yield the arguments of each trial, without errors of clocks, or of two sensors, that a robot does not have."""
    for robot in robots:
        settings = drive_settings("room", robot)
        stamped, has_two = settings.robot.driver != "arcos", settings.ring.sensor_count > 1
        for room, seed, moment in product(rooms, seeds, range(moments)):
            for kind in kinds:
                if (stamped or CLOCK not in kind) and (has_two or not kind.endswith(OF_TWO)):
                    yield robot, room, kind, seed, moment


def measure(plans: Iterable[Plan], tell: Callable[[str], None], *, recognises: bool = False) -> list[TrialResult]:
    """Return the results of all trials."""
    results: list[TrialResult] = []
    for plan in plans:
        results.append(run_trial(*plan, recognises=recognises))
        contacts, unnamed = sum(one.is_contact for one in results), sum(one.named_s is None for one in results)
        tell(
            f"{len(results)} drives, {contacts} contacts, {unnamed} without a name: {plan[0]} in {plan[1]}, {plan[2]}"
        )
    return results


def honest(robots: Sequence[str], rooms: Sequence[str], seeds: Iterable[int], moments: int) -> Iterator[Plan]:
    """Yield the arguments of each honest drive."""
    yield from (
        (robot, room, None, seed, k) for robot, room, seed, k in product(robots, rooms, seeds, range(moments))
    )


def lies_table(results: Sequence[TrialResult]) -> Table:
    """Return the table: contacts at speed, lies without a name, and seconds to the name, by kind and robot."""
    robots = list(dict.fromkeys(result.robot for result in results))
    drives = sum(result.drive_s for result in results) / 3600.0
    table = Table(
        title=f"{len(results)} drives, {drives:.1f} h: contacts above {AT_SPEED_M_S:g} m/s; lies without a "
        f"name / drives that went on for {MOVED_M:g} m or were named;\nmedian and greatest time to the name, s; of "
        f"honest drives stops / drives",
        title_justify="left",
    )
    table.add_column("lie")
    for robot in robots:
        table.add_column(robot, justify="right")
    for kind in dict.fromkeys(result.kind for result in results):
        of = [[one for one in results if (one.robot, one.kind) == (robot, kind)] for robot in robots]
        table.add_row(kind or "honest", *(_cell(ones) for ones in of))
    return table


def _cell(results: Sequence[TrialResult]) -> str:
    if not results:
        return "–"
    contacts, named = sum(one.is_contact for one in results), sorted(one.named_s for one in results if one.named_s)
    if results[0].kind is None:
        return f"{contacts} {len(named)}/{len(results)}"
    unnamed = sum(one.named_s is None and one.is_driving for one in results)
    times = f" {named[len(named) // 2]:.1f} {named[-1]:.1f}" if named else ""
    return f"{contacts} {unnamed}/{len(named) + unnamed}{times}"
