"""Honest runs in virtual time, every keyframe of which must be adopted; and how near numbers come to their bounds.

`python -m bench.keyframes` lets each shipped robot drive for an hour in each shipped world, with methods, evidence
grids, ways of localisation and the map of surfaces in turn, so that any two of these values meet; `--all` takes every
combination, and `--once` each robot in one world only. An hour takes some four minutes.
"""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated, Final, NamedTuple, get_args

import numpy as np
import orjson
from cyclopts import App, Parameter

from config.errors import DONE, FAILED
from config.files import list_shipped
from config.load import load_model, load_settings, with_known_room
from config.mission import MissionConfig
from config.settings import GridConfig, PerceptionConfig, Settings
from drivers.messages import Pose
from perception.bounds import COUNT, FINITE, PLACE, Bound
from perception.snapshot import bounds_of, numbers_of
from runtime.cycle.inputs import OperatorInput, Request
from runtime.cycle.modes import Mode
from runtime.cycle.preparation import fresh_state
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import decode, encode
from runtime.recording.replayer import adopt
from runtime.recording.schema import Keyframe, carried_state, keyframe
from runtime.simulation.closed_loop import SimulationOptions, simulate

ROBOTS: Final = list_shipped("robots")
WORLDS: Final = list_shipped("worlds")
METHODS: Final[tuple[str, ...]] = get_args(PerceptionConfig.model_fields["method"].annotation)
GRIDS: Final[tuple[str, ...]] = get_args(GridConfig.model_fields["method"].annotation)
SURFACES: Final = ("logs", "always")
"""When the map of surfaces is kept; in runs, or not."""
LINE_STEP_S: Final = 0.025
"""Two exchanges on the line in a cycle: the emulated line and base cost a third of what they do at the usual five
milliseconds, and states are the same in kind."""
PLACES: Final = ("odometry", "drift", "room")
"""Ways of localisation: by odometry, with correction of drift, in a known room."""
DAY_S: Final = 86_400.0
MODELS: Final = ("drum", "box")
"""Round and polygonal, besides those of the world's run."""
STUCK: Final = {"when": "stuck", "go": "turn"}
MISSION: Final = MissionConfig.model_validate({
    "name": "wander-and-follow",
    "endless": True,
    "step": [
        {
            "name": "wander",
            "schemas": [{"name": "wander", "seed": 1}],
            "until": [STUCK, {"when": "time", "after_s": 45.0, "go": "follow"}],
        },
        {
            "name": "follow",
            "schemas": [{"name": "follow_wall", "side": "left", "distance_m": 0.5}],
            "until": [STUCK, {"when": "time", "after_s": 90.0, "go": "wander"}],
        },
        {
            "name": "turn",
            "schemas": [{"name": "turn", "heading_deg": 137.0}],
            "until": [{"when": "reached", "go": "wander"}, {"when": "time", "after_s": 20.0, "go": "wander"}],
        },
    ],
})  # fmt: skip

app = App(help="Adopt every keyframe of honest runs in virtual time.")


class Run(NamedTuple):
    """What differs between two runs."""

    robot: str
    method: str
    grid: str
    place: str
    world: str
    surfaces: str


@dataclass
class Adopted:
    """What became of a run's keyframes."""

    keyframes: int = 0
    refused: list[str] = field(default_factory=list)
    way_m: float = 0.0
    largest: dict[str, float] = field(default_factory=dict)
    """Largest magnitude of each number whose bound is far away: places, counts, evidence and sums."""


def runs() -> Iterator[Run]:
    """Yield each robot in each world; any two values of a run meet in one of them."""
    for j, world in enumerate(WORLDS):
        for r, robot in enumerate(ROBOTS):
            place = PLACES[(r + j) % len(PLACES)]
            method, grid = METHODS[(j // 2 + r) % len(METHODS)], GRIDS[(r + j) % len(GRIDS)]
            yield Run(robot, method, grid, place, world, SURFACES[(j + 1 + r // 4 + r // 9) % len(SURFACES)])


def once() -> Iterator[Run]:
    """Yield one run of each robot; every method meets every grid, and all ways of localisation and worlds come up."""
    rows = tuple(runs())
    for r in range(len(ROBOTS)):
        yield rows[len(ROBOTS) * (r // len(WORLDS) % len(WORLDS)) + r]


def settings_of(run: Run) -> Settings:
    """Return the settings of a run."""
    sets = [
        f"perception.method={run.method}", f"perception.grid.method={run.grid}",
        f"perception.surfaces.map={run.surfaces}",
        f"perception.localization.correct_drift={str(run.place == 'drift').lower()}",
        "behaviors.arbiter.base_velocity_m_s=0.3",
    ]  # fmt: skip
    settings = load_settings(run.world, sets, robot=run.robot)
    if run.place == "room":
        settings = with_known_room(settings, run.world)
    names = {model.name for model in settings.models}
    models = (*settings.models, *(load_model(name) for name in MODELS if name not in names))
    return settings.model_copy(update={"models": models, "mission": MISSION, "goal": None})


def adopt_all(settings: Settings, seed: int, seconds: float, period_s: float) -> Adopted:
    """Drive, take a keyframe every `period_s`, write it, read it, and adopt its state as a replay does.

    Parameters
    ----------
    settings : Settings
        With a world.
    seed : int
        Of the emulated robot.
    seconds : float
        Virtual time.
    period_s : float
        Virtual time from one keyframe to the next.

    Raises
    ------
    ValueError
        The settings have no world.
    """
    if settings.world is None:
        raise ValueError("the settings name no world to drive in")
    found, last, every = Adopted(), list[Pose](), round(period_s * settings.cycle.rate_hz)
    bounds = bounds_of(fresh_state(settings).perception)

    def on_state(record: CycleRecord, state: State, _start: Pose) -> None:
        if state.odometry is not None:
            last.append(state.odometry.pose)
            found.way_m += math.hypot(last[-1].x - last[0].x, last[-1].y - last[0].y)
            del last[:-1]
        if record.cycle % every:
            return
        found.keyframes += 1
        snapshot = state.perception.snapshot()
        frame = keyframe(record.cycle, record.inputs.run_s, carried_state(state), snapshot)
        try:
            adopt(decode(Keyframe, encode(frame)), settings)
        except (ArithmeticError, LookupError, ValueError) as error:
            found.refused.append(f"after {record.inputs.run_s:.0f} s: {error}")
        for name, values in numbers_of(snapshot):
            if name in bounds and is_far(bounds[name]):
                finite = np.abs(values[np.isfinite(values)])
                found.largest[name] = float(finite.max(initial=0.0))

    def operator(cycle: int, state: State) -> OperatorInput:
        is_waiting = state.mode.mode in {Mode.READY, Mode.SAFE_STOP} and cycle % 20 == 0
        return OperatorInput(Request.ARM if is_waiting else None)

    simulate(
        settings,
        settings.world,
        seed,
        seconds,
        on_state=on_state,
        operator=operator,
        options=SimulationOptions(line_step_s=LINE_STEP_S),
    )
    return found


def is_far(bound: Bound) -> bool:
    """Return whether a bound is only there to be out of reach."""
    return bound.high in {PLACE.high, COUNT.high, FINITE.high} and not bound.constant


def shares_after(seconds: float, adopted: Adopted, settings: Settings) -> list[tuple[float, str]]:
    """Return how much of its bound each number takes after a day if it grows on as so far, greatest first.

    Parameters
    ----------
    seconds : float
        Length of the run.
    adopted, settings
        Of the run.
    """
    bounds = bounds_of(fresh_state(settings).perception)
    shares = ((value / bounds[name].high * DAY_S / seconds, name) for name, value in adopted.largest.items())
    return sorted(shares, reverse=True)


@app.default
def main(
    *,
    seconds: Annotated[float, Parameter(help="Virtual time of each run, s.")] = 3600.0,
    robots: Annotated[tuple[str, ...], Parameter(help="These only.")] = ROBOTS,
    worlds: Annotated[tuple[str, ...], Parameter(help="These only.")] = WORLDS,
    seed: Annotated[int, Parameter(help="Of the first run; each has its own.")] = 0,
    single: Annotated[bool, Parameter(name="--once", help="Each robot in one world only.")] = False,
    every: Annotated[bool, Parameter(name="--all", help="Every combination, not only each pair of values.")] = False,
) -> int:
    """Print a line of JSON for each run; exit with 1 if a keyframe was refused."""
    chosen = once() if single else runs()
    if every:
        chosen = (Run(*one) for one in itertools.product(ROBOTS, METHODS, GRIDS, PLACES, WORLDS, SURFACES))
    is_good = True
    for number, run in enumerate(chosen, seed):
        if run.robot not in robots or run.world not in worlds:
            continue
        settings = settings_of(run)
        found = adopt_all(settings, number, seconds, settings.recording.keyframe_period_s)
        share, name = shares_after(seconds, found, settings)[0]
        row = {
            **run._asdict(), "seed": number, "seconds": seconds, "way_m": round(found.way_m, 1),
            "keyframes": found.keyframes, "refused": found.refused, "nearest_after_a_day": [name, share],
        }  # fmt: skip
        sys.stdout.write(orjson.dumps(row).decode() + "\n")
        sys.stdout.flush()
        is_good = is_good and not found.refused
    return DONE if is_good else FAILED


if __name__ == "__main__":
    sys.exit(app())
