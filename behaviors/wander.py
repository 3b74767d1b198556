"""The wander schema: a random direction in which the way is free, kept for a while, then another.

MissionLab's wander is its noise schema beside avoid-static-obstacle. Directions drawn without looking lead to walls
for most of the time, so a few are drawn here and the first whose way is free is taken. Memory: `index` counts the
draws, `x` is the direction (rad), `since_s` when it was drawn.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from behaviors.response import Response
from behaviors.schema_call import Answer, Memory, Scene
from behaviors.surroundings.clearance import free_path_m
from config.mission_step import WanderUse

SCHEMA: Final = "wander"
DRAWS: Final = 8
"""Directions drawn at a time; if the way is free in none, the freest is taken."""
BLOCKED_M: Final = 0.1
"""Free way ahead below which another direction is drawn before its time, m."""
KEPT_S: Final = 1.0
"""A direction is kept for so long at least, s: the ring needs as much to look there."""
MASK: Final = 2**64 - 1


def uniform(seed: int, index: int) -> float:
    """Return a number of [0, 1) that depends on seed and index only, as if random.

    The finaliser of SplitMix64 (Steele, Lea & Flood, *Fast Splittable Pseudorandom Number Generators*, 2014).
    """
    z = (seed * 0x9E3779B97F4A7C15 + (index + 1) * 0xD1B54A32D192ED03) & MASK
    z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & MASK
    return ((z ^ (z >> 31)) >> 11) / 2.0**53


def wander(scene: Scene, memory: Memory, use: WanderUse) -> Answer:
    """Return a vector in the direction drawn last, or in another if its time is up or its way is blocked.

    Parameters
    ----------
    scene
        Pose, echoes and body.
    memory
        The direction and when it was drawn.
    use
        Gain, seed, persistence and the free way that is looked for.
    """
    kept_s = scene.step_s - memory.since_s
    is_blocked = memory.is_set and kept_s >= KEPT_S and _free_m(scene, memory.x) < BLOCKED_M
    if not memory.is_set or is_blocked or kept_s >= use.persistence_s:
        memory = _drawn(scene, memory, use)
    x, y = use.gain * math.cos(memory.x), use.gain * math.sin(memory.x)
    return Answer(Response(SCHEMA, x, y), memory)


def _drawn(scene: Scene, memory: Memory, use: WanderUse) -> Memory:
    """Return the memory with a new direction: the first drawn that is free for `use.free_m`, else the freest."""
    best, best_free_m, index = 0.0, -1.0, memory.index
    for _ in range(DRAWS):
        direction = 2.0 * math.pi * uniform(use.seed, index) - math.pi
        index += 1
        free_m = _free_m(scene, direction)
        if free_m > best_free_m:
            best, best_free_m = direction, free_m
        if free_m >= use.free_m:
            break
    return replace(memory, index=index, x=best, since_s=scene.step_s, is_set=True)


def _free_m(scene: Scene, direction_rad: float) -> float:
    """Return how far the body with its clearance can drive in a direction, m."""
    turned = replace(scene.percept, pose=replace(scene.percept.pose, theta=direction_rad))
    return free_path_m(turned, scene.body.radius_m + scene.behaviors.arbiter.clearance_m)
