"""The schemas that others use against dead ends, each where its gain is not zero: avoid-past, noise, swirl."""

from __future__ import annotations

from behaviors.avoid_past import Trail, avoid_past
from behaviors.noise import noise
from behaviors.response import Response
from behaviors.swirl import swirl
from config.settings import Settings
from perception.percept import Percept


def escape_schemas(
    percept: Percept, way_rad: float, run_s: float, trail: Trail, settings: Settings
) -> tuple[tuple[Response, ...], Trail]:
    """Return their vectors, and the trail for the next cycle.

    `way_rad` is the direction of the goal or of the leg in odometry's frame; `trail` is where the robot has been,
    from the cycle before.
    """
    behaviors, responses = settings.behaviors, []
    if behaviors.avoid_past.avoid_past_gain > 0.0:
        past, trail = avoid_past(percept, trail, behaviors.avoid_past)
        responses.append(past)
    if behaviors.noise.noise_gain > 0.0:
        responses.append(noise(run_s, behaviors.noise))
    if behaviors.swirl.swirl_gain > 0.0:
        responses.append(swirl(percept, way_rad, settings.body.radius_m, behaviors.swirl))
    return tuple(responses), trail
