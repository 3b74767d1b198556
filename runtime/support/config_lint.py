"""Warnings about settings that are each valid but unsuitable in combination."""

from __future__ import annotations

import math

from config.robot import NO_BODY
from config.settings import Settings
from drivers.capabilities import missing
from drivers.registry import capabilities
from runtime.support.blind_sides import blind_notes
from runtime.support.pattern_check import crosstalk_note, gap_note, more_looks, pattern_speed_m_s


def lint_settings(settings: Settings) -> list[str]:
    """Return warnings about these settings, one sentence each."""
    if settings.body == NO_BODY:
        return ["body: none is described: the file is good for replays, stands and maps; to drive, add a [body]"]
    warnings = []
    inside_m = min(
        settings.body.radius_m - mount.x_m * math.cos(mount.angle_rad) - mount.y_m * math.sin(mount.angle_rad)
        for mount in settings.ring.mounts
    )
    blind_m = settings.ring.range_min_m - max(0.0, inside_m)
    avoid, arbiter = settings.behaviors.avoid_static_obstacle, settings.behaviors.arbiter
    margins = {
        "behaviors.avoid_static_obstacle.avoid_obstacle_safety_margin_m": avoid.avoid_obstacle_safety_margin_m,
        "behaviors.arbiter.clearance_m": arbiter.clearance_m,
    }
    for path, margin_m in margins.items():
        if margin_m <= blind_m:
            warnings.append(
                f"{path} = {margin_m} is not above ring.range_min_m = {settings.ring.range_min_m}: nearer obstacles "
                "are never reported, so this margin has no effect; make it larger, or set the sensors back from "
                "the rim"
            )
    firing_hz = 1.0 / settings.ring.firing.step_period_s
    if settings.cycle.rate_hz < 0.5 * firing_hz:
        warnings.append(
            f"cycle.rate_hz = {settings.cycle.rate_hz:g} is less than half of {firing_hz:g} firings a second: "
            "several firings wait for each cycle"
        )
    localization = settings.perception.localization
    if settings.mission is not None and settings.mission.needs_map and not localization.has_map:
        warnings.append(
            f"mission {settings.mission.name} names places in the map, but the run has none, so it stands: run with "
            "--map FILE or with perception.localization.correct_drift = true, or name places in odom"
        )
    speed_m_s = pattern_speed_m_s(settings)
    if (gap := gap_note(settings)) is not None:
        warnings.append(gap)
    elif speed_m_s < min(arbiter.base_velocity_m_s, settings.body.speed_max_m_s):
        warnings.append(
            f"ring.firing: the pattern looks ahead so seldom that it limits the speed to {speed_m_s:.2f} m/s, below "
            f"behaviors.arbiter.base_velocity_m_s = {arbiter.base_velocity_m_s:g}; {more_looks(settings.ring)}"
        )
    elif pattern_speed_m_s(settings, missed=1) == 0.0:
        overlap = "" if settings.ring.has_servo else ", or let beams overlap"  # with more bearings, they do
        warnings.append(
            "ring.firing: one reading that fails leaves the way unseen for longer than "
            f"behaviors.avoid_static_obstacle.echo_age_max_s = {avoid.echo_age_max_s:g}: the robot stops until that "
            f"sensor answers again; {more_looks(settings.ring)}{overlap}"
        )
    fires = settings.link.port != "ros2"  # there the sensors' own nodes do, or a simulator, which has no crosstalk
    if fires and (crosstalk := crosstalk_note(settings.ring)) is not None:
        warnings.append(crosstalk)
    lacks = missing(capabilities(settings)).values()
    return [*warnings, *(f"robot.driver = {settings.robot.driver}: {text}" for text in lacks), *blind_notes(settings)]
