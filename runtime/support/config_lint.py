"""Settings that are allowed, each by itself, and still unwise together."""

from __future__ import annotations

from config.settings import Settings


def lint_settings(settings: Settings) -> list[str]:
    """Return what an experienced operator would say about these settings, a sentence each."""
    said = []
    blind_m = settings.ring.range_min_m
    avoid, arbiter = settings.behaviors.avoid_static_obstacle, settings.behaviors.arbiter
    margins = {
        "behaviors.avoid_static_obstacle.avoid_obstacle_safety_margin_m": avoid.avoid_obstacle_safety_margin_m,
        "behaviors.arbiter.clearance_m": arbiter.clearance_m,
    }
    for path, margin_m in margins.items():
        if margin_m <= blind_m:
            said.append(
                f"{path} = {margin_m} is not above ring.range_min_m = {blind_m}: nothing nearer than that is ever "
                "reported, so this margin never acts; make it larger"
            )
    pace_hz = 1.0 / settings.ring.firing.step_period_s
    if settings.cycle.rate_hz < 0.5 * pace_hz:
        said.append(
            f"cycle.rate_hz = {settings.cycle.rate_hz:g} is less than half the ring's {pace_hz:g} firings a second: "
            "several firings wait for each cycle"
        )
    return said
