"""Slips of the robot that its wheels do not report, half-way through three rounds among eight drums."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Final

import numpy as np

from config.settings import LocalizationConfig, Settings
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose, wrap_angle
from perception.pipeline import Perception
from runtime.simulation.drift_trials import LEVELS, STEP_FT, drum_hall, odometry_along, oval
from runtime.simulation.open_loop import perceive
from runtime.simulation.scenes import OCTET, SPEED_M_S

SLIPS: Final = (
    Pose(0.0, 0.15, 0.0), Pose(0.0, 0.2, 0.0), Pose(0.0, 0.6, 0.0), Pose(0.0, 0.4, math.radians(20.0)),
)  # fmt: skip
"""Of the robot, as seen from where it is believed to be."""
SLIPS_AT: Final = 700
END_AT: Final = 1250
"""Firings until the slip, and until the end: the slipped path ends before it touches a drum."""


def slip_once(settings: Settings, slip: Pose, seed: int) -> tuple[float, float, float, int]:
    """Drive once; return the errors of place (m), heading (rad) and worst object (m), and the objects' number."""
    world, path, errors = drum_hall(seed), oval(), LEVELS[1]
    turned = path[SLIPS_AT].compose(slip).compose(path[SLIPS_AT].inverse())
    sonar = Sonar(settings.ring, compile_scene(world), world.acoustics,
                  np.random.default_rng(np.random.SeedSequence([seed, 1])))  # fmt: skip
    reported = odometry_along(path, errors, np.random.default_rng(np.random.SeedSequence([seed, 7])))
    config = settings.perception.model_copy(update={"localization": LocalizationConfig(correct_drift=True)})
    perception = Perception(settings.ring, settings.models, config)
    true = path[0]
    for k, (planned, pose) in enumerate(zip(path[: END_AT + 1], reported, strict=False)):
        true = planned if k < SLIPS_AT else turned.compose(planned)
        ranges = sonar.fire(true, true.theta, range(k % OCTET, len(settings.ring.mounts), OCTET))
        perceive(perception, Firing(k * STEP_FT / SPEED_M_S, pose, pose.theta, ranges))
    here = perception.localized()
    if here is None:
        raise ValueError("perception does not correct drift")
    drums = [(drum.x_m, drum.y_m) for drum in world.drum]
    off = [min(math.dist((seen.x, seen.y), drum) for drum in drums) for seen in perception.mapped_objects()]
    place = math.dist((here.pose.x, here.pose.y), (true.x, true.y))
    return place, abs(wrap_angle(here.pose.theta - true.theta)), max(off, default=math.inf), len(off)


def measure(settings: Settings, seeds: Iterable[int], report: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return the worst figures of the drives, by slip; lengths in metres.

    Parameters
    ----------
    settings
        Ring, models and perception.
    seeds
        Which halls.
    report
        Called with a line on what is running.
    """
    seeds, rows = tuple(seeds), {}
    for slip in SLIPS:
        name = f"{slip.y:g} m, {math.degrees(slip.theta):.0f}°"
        outcomes = []
        for seed in seeds:
            report(f"slips: {name}, hall {seed}")
            outcomes.append(slip_once(settings, slip, seed))
        place, heading, worst, objects = (np.array(column) for column in zip(*outcomes, strict=True))
        rows[name] = {
            "drives": float(len(seeds)), "place_m": float(place.max()), "heading_deg": math.degrees(heading.max()),
            "object_m": float(worst.max()), "objects": float(objects.mean()),
        }  # fmt: skip
    return rows
