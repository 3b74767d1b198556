"""The shipped missions, each driven in the emulated room, in virtual time; the long forms drive each to its end."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from behaviors.missions.mission import Mission
from config.load import list_shipped, load_settings
from drivers.emulator.robot_device import GroundTruth
from drivers.messages import Pose, Twist
from runtime.cycle.modes import Mode
from runtime.cycle.step import CycleRecord, State
from runtime.simulation.closed_loop import simulate

FAST = ("behaviors.arbiter.base_velocity_m_s=0.5",)
SHORT_S = {
    "dock": 14.0, "dock-from-behind": 12.0, "guard": 12.0, "inspect-drums": 14.0, "mow": 12.0, "patrol": 20.0,
    "round-the-room": 14.0, "stay-on-path": 21.0, "there-and-back": 22.0, "wander": 12.0,
}  # fmt: skip
OF_EACH_KIND = ("dock", "guard", "patrol")
"""Those which the quick form drives: with drums to recognise and without."""
LONG_S = {"round-the-room": 150.0, "inspect-drums": 150.0, "wander": 125.0, "patrol": 120.0}
NEEDS_DRUMS = {"dock", "dock-from-behind", "guard", "inspect-drums"}


@dataclass
class Drive:
    """What a mission did."""

    mission: Mission
    steps: list[str] = field(default_factory=list)
    way_m: float = 0.0
    places: list[tuple[float, float]] = field(default_factory=list)
    unexplained: int = 0
    """Cycles in DRIVE without motion and without a reason."""
    contacts: bool = False
    mode: Mode = Mode.CONNECTING


def driven(name: str, seconds: float, *sets: str, seed: int = 0) -> Drive:
    """Drive a mission in the room; without drums to recognise, perception does only what avoiding needs."""
    method = "bayes" if name in NEEDS_DRUMS else "paper"
    settings = load_settings("room", [f"perception.method={method}", *sets], mission=name)
    assert settings.world is not None
    assert settings.mission is not None
    drive = Drive(Mission(settings.mission))

    def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
        assert isinstance(state.drive_request, Mission)
        drive.mission, drive.mode = state.drive_request, state.mode.mode
        if not drive.steps or drive.steps[-1] != drive.mission.step.name:
            drive.steps.append(drive.mission.step.name)
        if state.mode.mode is Mode.DRIVE and record.command == Twist(0.0, 0.0) and state.hold_reason is None:
            drive.unexplained += 1
        if state.odometry is not None:
            drive.places.append((state.odometry.pose.x, state.odometry.pose.y))

    def on_cycle(_record: CycleRecord, truth: GroundTruth) -> None:
        drive.contacts |= truth.contacts > 0

    simulate(settings, settings.world, seed, seconds, on_cycle, on_state=on_state)
    drive.way_m = sum(math.dist(a, b) for a, b in zip(drive.places, drive.places[1:], strict=False))
    return drive


def visited(drive: Drive, x: float, y: float) -> bool:
    return min(math.dist(place, (x, y)) for place in drive.places) < 0.25


EARLY: dict[str, Callable[[Drive], bool]] = {
    "dock": lambda d: d.mission.progress.status == "done" and d.steps == ["search", "dock"],
    "dock-from-behind": lambda d: d.steps == ["search", "dock"] and d.way_m > 2.0,
    "guard": lambda d: d.steps[:2] == ["stroll", "challenge"],
    "inspect-drums": lambda d: d.steps[:4] == ["search", "approach", "look", "search"],
    "mow": lambda d: visited(d, 1.8, 0.0) and d.way_m > 3.0,
    "patrol": lambda d: d.steps[:4] == ["east", "north", "west", "home"],
    "round-the-room": lambda d: d.steps == ["to-the-wall", "along-the-wall"] and d.way_m > 4.0,
    "stay-on-path": lambda d: d.mission.progress.status == "done" and visited(d, 1.3, 1.2),
    "there-and-back": lambda d: d.mission.progress.status == "done" and visited(d, 1.5, 0.0),
    "wander": lambda d: d.way_m > 2.0,
}
"""What each has done after its short time."""
COMPLETE: dict[str, Callable[[Drive], bool]] = {
    "inspect-drums": lambda d: len(d.mission.progress.visited) == 3,
    "round-the-room": lambda d: visited(d, 3.6, 0.0) and visited(d, -3.7, 0.0) and visited(d, 0.0, -2.1),
    "wander": lambda d: max(x for x, _ in d.places) - min(x for x, _ in d.places) > 3.0,
    "patrol": lambda d: d.steps.count("home") >= 3,
}
"""What those have done in the end that the short time leaves open."""


@pytest.mark.compiled
@pytest.mark.promise("P32")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if name in OF_EACH_KIND else [pytest.mark.soak]) for name in SHORT_S]
)
def test_a_shipped_mission_does_what_it_is_named_for(name: str) -> None:
    assert SHORT_S.keys() == {*list_shipped("missions")}
    drive = driven(name, SHORT_S[name], *FAST)
    assert drive.mode is Mode.DRIVE
    assert not drive.contacts
    assert drive.unexplained == 0
    assert EARLY[name](drive), (drive.steps, drive.mission.progress.reason, drive.way_m)


@pytest.mark.soak
@pytest.mark.promise("P32")
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", SHORT_S)
def test_a_shipped_mission_comes_to_its_end(name: str, seed: int) -> None:
    drive = driven(name, LONG_S.get(name, 90.0), seed=seed)
    assert drive.mode is Mode.DRIVE
    assert not drive.contacts
    assert drive.unexplained == 0
    assert drive.mission.progress.status == ("running" if name == "patrol" else "done"), drive.mission.progress
    assert name not in COMPLETE or COMPLETE[name](drive)
