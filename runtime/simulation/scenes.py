"""Scenes for measuring recognition: halls as pure data, and drives through them that need no robot.

Exact poses and readings of the whole ring exclude the base, the serial line and the clock, so that all errors are
perception's own, and other estimators can get the same readings. Lengths are in feet, as in the paper.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Literal

import numpy as np

from config.robot import RingConfig
from config.units import FOOT_M
from config.world import AcousticsConfig, BoxConfig, DrumConfig, StartConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.messages import Firing, Pose
from runtime.simulation.random_halls import random_hall
from runtime.simulation.scene_names import SceneName

PLACES_FT: Final = tuple((x, y) for y in (4.0, -4.0) for x in (1.0, 4.0, 7.0))
"""Positions of the paper's six drums (its Table 2)."""
FROM_FT: Final = -6.0
TO_FT: Final = 14.0
STEP_FT: Final = 0.25
READINGS: Final = 1 + round((TO_FT - FROM_FT) / STEP_FT)
"""Readings of one drive down the hall."""
SPEED_M_S: Final = 0.3
"""Speed of the robot; there is a reading every quarter of a second."""

DRUM_RADIUS_FT: Final = 1.0
BOX_SIDE_FT: Final = 2.0
WALLS_FT: Final = ((-14.0, 8.0, 17.0, 8.0), (-14.0, -8.0, 17.0, -8.0), (17.0, -8.0, 17.0, 8.0))
"""Ends x, y, x, y: walls at y = ±8 and x = 17, of which the side walls start far behind the robot."""
MOVES_FT: Final = 0.4
"""Largest random offset of a drum along the hall and across it."""
MOVED_HALLS: Final = 10
OCTET: Final = 3
"""On a path every third sensor fires at once, in turn."""


@dataclass(frozen=True, slots=True)
class Hall:
    """A named world with a path through it."""

    name: str
    world: WorldConfig
    path: tuple[tuple[float, float, float], ...] = ()
    """Where the ring fires, octet by octet: x, y (m) and its direction (rad). Empty: straight down the hall."""


def halls(name: SceneName, seed: int = 0) -> tuple[Hall, ...]:
    """Return the halls of a scene.

    Parameters
    ----------
    name : SceneName
        The scene.
    seed : int
        Of the drums' offsets in `moved` and `jit10`, which are the same in both, and of everything in `halls`. The
        other scenes do not depend on it.
    """
    return _SCENES[name](seed)


def readings(ring: RingConfig, hall: Hall, seed: int, passes: int = 1) -> Iterator[Firing]:
    """Yield the readings of a drive down the hall, and then back and forth again, at exact poses.

    All sensors fire at once, `READINGS` times a pass; in a hall with a path, the octets fire in turn, one at each of
    its points. As on a synchro drive, the ring does not turn at the ends of the hall. Poses are in world coordinates;
    times follow from `SPEED_M_S`.

    Parameters
    ----------
    ring : RingConfig
        The sensors.
    hall : Hall
        The world and the path.
    seed : int
        Of the noise.
    passes : int
        Number of drives through the hall.
    """
    acoustics = hall.world.acoustics
    sonar = Sonar(
        ring, compile_scene(hall.world), acoustics, np.random.default_rng(np.random.SeedSequence([seed, 1]))
    )
    for passed in range(passes if hall.path else 0):
        yield from _along(hall.path, passed, sonar, len(ring.mounts))
    for passed in range(0 if hall.path else passes):
        for k in range(READINGS):
            ahead = FROM_FT + STEP_FT * k
            back = passed % 2 == 1
            pose = Pose((FROM_FT + TO_FT - ahead if back else ahead) * FOOT_M, 0.0, math.pi if back else 0.0)
            t_s = (passed * READINGS + k) * STEP_FT * FOOT_M / SPEED_M_S
            yield Firing(t_s, pose, 0.0, sonar.fire(pose, 0.0))


def _along(path: tuple[tuple[float, float, float], ...], passed: int, sonar: Sonar, sensors: int) -> Iterator[Firing]:
    """Yield the readings along a path, on every other pass backwards."""
    for k, (x, y, yaw) in enumerate(path[:: -1 if passed % 2 else 1]):
        pose = Pose(x, y, 0.0)
        t_s = (passed * len(path) + k) * math.dist(path[0][:2], path[-1][:2]) / len(path) / SPEED_M_S
        yield Firing(t_s, pose, yaw, sonar.fire(pose, yaw, range(k % OCTET, sensors, OCTET)))


def _random(seed: int) -> tuple[Hall, ...]:
    world, path = random_hall(seed)
    return (Hall(f"halls {seed}", world, path),)


def _acoustics(noise_ft: float = 0.0, dropout: float = 0.0, outliers: float = 0.0) -> AcousticsConfig:
    return AcousticsConfig(
        model="specular",
        noise_m=noise_ft * FOOT_M,
        dropout=dropout,
        outliers=outliers,
        outlier_max_m=15.0 * FOOT_M,
    )


_CLEAN: Final = _acoustics()
_NOISY: Final = _acoustics(noise_ft=0.05, dropout=0.10, outliers=0.03)
_JIT: Final = _acoustics(noise_ft=0.03, dropout=0.05, outliers=0.01)
_START: Final = StartConfig(x_m=FROM_FT * FOOT_M)


def _drums(places_ft: tuple[tuple[float, float], ...], acoustics: AcousticsConfig) -> WorldConfig:
    radius = DRUM_RADIUS_FT * FOOT_M
    drums = tuple(DrumConfig(x_m=x * FOOT_M, y_m=y * FOOT_M, radius_m=radius) for x, y in places_ft)
    return WorldConfig(drum=drums, start=_START, acoustics=acoustics)


def _walled() -> WorldConfig:
    ends = [tuple(v * FOOT_M for v in wall) for wall in WALLS_FT]
    walls = tuple(WallConfig(x1_m=x1, y1_m=y1, x2_m=x2, y2_m=y2) for x1, y1, x2, y2 in ends)
    return _drums(PLACES_FT, _CLEAN).model_copy(update={"wall": walls})


def _moved(name: str, seed: int, acoustics: AcousticsConfig) -> tuple[Hall, ...]:
    rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
    moves = rng.uniform(-MOVES_FT, MOVES_FT, (MOVED_HALLS, len(PLACES_FT), 2))
    places = [tuple((float(x), float(y)) for x, y in np.array(PLACES_FT) + move) for move in moves]
    return tuple(Hall(f"{name} {i}", _drums(where, acoustics)) for i, where in enumerate(places))


def _boxes(name: str, angle_deg: float) -> tuple[Hall, ...]:
    """Return a hall with boxes in place of drums, turned by an angle, for each way that surfaces answer."""
    side = BOX_SIDE_FT * FOOT_M
    boxes = tuple(
        BoxConfig(x_m=x * FOOT_M, y_m=y * FOOT_M, width_m=side, depth_m=side, angle_deg=angle_deg)
        for x, y in PLACES_FT
    )
    models: tuple[Literal["cone"], Literal["specular"]] = ("cone", "specular")
    return tuple(
        Hall(f"{name} {model}", WorldConfig(box=boxes, start=_START, acoustics=AcousticsConfig(model=model)))
        for model in models
    )


_SCENES: Final[Mapping[SceneName, Callable[[int], tuple[Hall, ...]]]] = MappingProxyType(
    {
        "clean": lambda _: (Hall("clean", _drums(PLACES_FT, _CLEAN)),),
        "moved": lambda seed: _moved("moved", seed, _CLEAN),
        "noisy": lambda _: (Hall("noisy", _drums(PLACES_FT, _NOISY)),),
        "walls": lambda _: (Hall("walls", _walled()),),
        "jit10": lambda seed: _moved("jit10", seed, _JIT),
        "boxes": lambda _: _boxes("boxes_facing", 0.0) + _boxes("boxes_45", 45.0),
        "boxes_facing": lambda _: _boxes("boxes_facing", 0.0),
        "boxes_45": lambda _: _boxes("boxes_45", 45.0),
        "halls": _random,
    }
)
