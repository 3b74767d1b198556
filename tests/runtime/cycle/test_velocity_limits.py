"""No-go areas, speed areas and named places in the closed loop, whatever is driven; replays are equal to the bit."""

import math

import numpy as np
import pytest

from behaviors.missions.mission import Mission
from behaviors.move_to_goal import Goal
from behaviors.no_go import zones_of
from behaviors.teleoperation import Teleoperate
from config.load import load_settings, with_mission
from config.mission import MissionConfig, StepConfig
from config.mission_step import MoveToGoalUse, ReachedCondition, TimeCondition, UnreachableCondition, WanderUse
from config.places import NoGoAreaConfig, NoGoLineConfig, PlaceConfig, PlacesConfig
from config.settings import Settings
from drivers.messages import Pose
from runtime.cycle.drive_requests import Legs
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.step import STANDSTILL, CycleRecord, State
from runtime.cycle.velocity_limits import VOID
from runtime.simulation.closed_loop import simulate
from tests.runtime.cycle.requested_robot import RequestedRobot, driving, hold_reason

ROOM = load_settings("room", ["perception.method=paper"])
STOPPING_ERROR_M = 0.0
"""The margin that is kept holds all that the base does otherwise than it should."""


def random_places(rng: np.random.Generator) -> PlacesConfig:
    """Return places of the emulated room: two free ones, and up to three zones that leave them and the start free."""
    places = tuple(
        PlaceConfig(name=name, x_m=x, y_m=y) for name, x, y in (("charger", -1.5, -1.5), ("lift", 3.4, 0.2))
    )
    free = [(0.0, 0.0), *((place.x_m, place.y_m) for place in places)]
    areas, lines = list[NoGoAreaConfig](), list[NoGoLineConfig]()
    while len(areas) + len(lines) < 3:
        x, y, size = float(rng.uniform(-3.5, 3.5)), float(rng.uniform(-2.5, 2.5)), float(rng.uniform(0.2, 0.7))
        if min(math.dist((x, y), at) for at in free) < size + 0.9:
            continue
        turns = np.sort(rng.uniform(0.0, 2.0 * math.pi, 5)).tolist()
        corners = tuple((x + size * math.cos(a), y + size * math.sin(a)) for a in turns)
        if rng.random() < 0.4:
            lines.append(NoGoLineConfig(points_m=corners[:3]))
        else:
            areas.append(NoGoAreaConfig(vertices_m=corners))
    return PlacesConfig(place=places, no_go_area=tuple(areas), no_go_line=tuple(lines))


def mission(*steps: StepConfig) -> MissionConfig:
    return MissionConfig(name="errand", step=steps)


def to_place(name: str) -> StepConfig:
    return StepConfig(name=f"to-{name}", schemas=(MoveToGoalUse(name="move_to_goal", place=name),))


def least_gap_m(settings: Settings, seed: int, seconds: float, teleoperated: bool = False) -> tuple[float, State]:
    """Return how near the rim truly comes to a zone in the room, m, and the state at the end."""
    zones, world = zones_of(settings.places), ROOM.world
    assert world is not None
    rng, least = np.random.default_rng(seed), [math.inf]
    asked = Teleoperate(0.4, 0.0)

    def on_state(_record: CycleRecord, _state: State, start: Pose) -> None:
        here = start.inverse().compose(truth[-1])
        at = np.array((here.x, here.y))
        least[0] = min(least[0], *(float(zone.distances_m(at)) - settings.body.radius_m for zone in zones.no_go))

    truth: list[Pose] = []

    def operator(cycle: int, state: State) -> OperatorInput:
        nonlocal asked
        if cycle % 30 == 0:
            asked = Teleoperate(float(rng.choice([0.5, 0.5, -0.5])), float(rng.uniform(-1.0, 1.0)))
        request = Request.ARM if state.mode.mode is Mode.READY else None
        return OperatorInput(request, drive_request=asked)

    def is_over(state: State) -> bool:
        return isinstance(state.drive_request, Mission) and state.drive_request.progress.status != "running"

    result = simulate(
        settings, world, seed, seconds, lambda _, now: truth.append(now.pose), on_state=on_state,
        operator=operator if teleoperated else None, is_over=is_over,
    )  # fmt: skip
    return least[0], result.state


@pytest.mark.parametrize("seed", [0])
@pytest.mark.parametrize("places", [("lift",), pytest.param(("lift", "charger"), marks=pytest.mark.soak)])
def test_a_mission_arrives_at_its_places_and_enters_no_zone(seed: int, places: tuple[str, ...]) -> None:
    room = ROOM.model_copy(update={"places": random_places(np.random.default_rng(seed))})
    settings = with_mission(room, mission(*map(to_place, places)))
    gap_m, state = least_gap_m(settings, seed, 150.0)
    assert gap_m > -STOPPING_ERROR_M
    assert isinstance(state.drive_request, Mission)
    assert state.drive_request.progress.status == "done", state.hold_reason
    assert state.odometry is not None


def wandering(seed: int) -> MissionConfig:
    return mission(
        StepConfig(
            name="stroll",
            schemas=(WanderUse(name="wander", seed=seed),),
            stuck_after_s=1e4,
            until=(TimeCondition(when="time", after_s=600.0),),
        )
    )


@pytest.mark.parametrize(("seed", "seconds"), [(0, 6.0), pytest.param(0, 25.0, marks=pytest.mark.soak)])
def test_neither_wander_nor_an_operator_enters_a_zone(seed: int, seconds: float) -> None:
    places = random_places(np.random.default_rng(100 + seed))
    given = ROOM.model_copy(update={"places": places})
    assert least_gap_m(with_mission(given, wandering(seed)), seed, seconds)[0] > -STOPPING_ERROR_M
    assert least_gap_m(given, seed, seconds, teleoperated=True)[0] > -STOPPING_ERROR_M


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(1, 42))
def test_nothing_enters_a_zone_in_many_rooms(seed: int) -> None:
    places = random_places(np.random.default_rng(seed))
    errand = mission(to_place("lift"), to_place("charger"))
    gap_m, state = least_gap_m(with_mission(ROOM.model_copy(update={"places": places}), errand), seed, 150.0)
    assert gap_m > -STOPPING_ERROR_M
    assert isinstance(state.drive_request, Mission)
    # Some draws leave no way between zones, walls and drums: the mission is held then, and says where it is stuck.
    assert state.drive_request.progress.status in {"done", "held"}, state.hold_reason
    test_neither_wander_nor_an_operator_enters_a_zone(seed, 25.0)


AREA = PlacesConfig(
    place=(PlaceConfig(name="lift", x_m=2.0, y_m=2.0),),
    no_go_area=(NoGoAreaConfig(name="rug", vertices_m=((1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0))),),
)


def with_area(script: RequestedRobot) -> RequestedRobot:
    script.settings = script.settings.model_copy(update={"places": AREA})
    return script


def test_a_goal_in_an_area_is_refused_and_named() -> None:
    script = with_area(driving())
    record = script.request_drive(Goal(1.5, 0.0))
    assert [one.why for one in record.refused] == [
        "the goal lies in or beside the no-go area rug: set it elsewhere, or change the area"
    ]
    assert not script.request_drive(Goal(4.0, 0.0)).refused


def test_a_mission_with_a_step_into_an_area_is_refused_unless_the_step_says_what_follows() -> None:
    script = with_area(driving())
    step = StepConfig(name="visit", schemas=(MoveToGoalUse(name="move_to_goal", x_m=1.5, y_m=0.0),))
    (refused,) = script.request_drive(Mission(mission(step))).refused
    assert refused.why.startswith("the goal of step visit lies in or beside the no-go area rug: set it elsewhere")
    until = (ReachedCondition(when="reached"), UnreachableCondition(when="unreachable", go="failed"))
    assert not script.request_drive(Mission(mission(step.model_copy(update={"until": until})))).refused
    script.request_drive(None)
    assert isinstance(script.state.drive_request, Mission)
    assert script.state.drive_request.progress.status == "failed"


@pytest.mark.parametrize("is_mission", [False, True])
def test_a_goal_over_which_an_area_is_drawn_is_given_up_at_once(is_mission: bool) -> None:
    script = driving()
    step = StepConfig(name="visit", schemas=(MoveToGoalUse(name="move_to_goal", x_m=1.5, y_m=0.0),))
    script.request_drive(Mission(mission(step)) if is_mission else Goal(1.5, 0.0))
    assert script.request_drive(None).command != STANDSTILL
    with_area(script)
    assert script.request_drive(None).command == STANDSTILL
    assert "the goal is unreachable: it lies in or beside the no-go area rug" in hold_reason(script)
    script.settings = script.settings.model_copy(update={"places": PlacesConfig()})
    assert script.request_drive(None).command == STANDSTILL, "it does not set out again by itself"
    assert "the no-go area rug" in hold_reason(script)


def test_places_of_odometry_are_void_after_its_restart_until_they_are_set_again() -> None:
    script = with_area(driving())
    script.cycle(rebooted=True)
    while script.state.mode.mode is not Mode.DRIVE:
        script.cycle(request=Request.ARM)
    record = script.request_drive(Legs())
    assert record.command is not None
    assert script.state.hold_reason == VOID
    record = script.request_drive(Teleoperate(0.3, 0.0))
    assert script.state.hold_reason == VOID
    assert 0.0 < record.command.v <= script.settings.behaviors.arbiter.cautious_velocity_m_s  # type: ignore[union-attr]
    script.settings = script.settings.model_copy(update={"places": replace_name(AREA)})
    script.request_drive(Legs())
    assert script.state.hold_reason != VOID


def replace_name(places: PlacesConfig) -> PlacesConfig:
    """Return places that an operator has set again."""
    return places.model_copy(update={"place": ()})
