"""The emulator's cross paths against bursts of sound: images of the transmitter, a wave form, and a threshold.

The simulator shares no code with the emulator. Walls make images of the transmitter, up to three deep, and each image
is traced back wall by wall; posts are sampled along their rim. Every path that both beams admit arrives as a burst of
50 kHz, sixteen periods long, as loud as its reflector, and the sum is sampled each microsecond. The receiver's gain
makes up for the way. It triggers where the sum first passes a tenth of a wall's loudness.

The emulator has what one surface or one corner reflects. What comes only round the room, over walls that do not meet
or over three, is counted apart.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from config.load import load_robot
from config.robot import SOUND_SPEED_M_S
from config.world import AcousticsConfig, DrumConfig, StartConfig, WallConfig, WorldConfig
from drivers.emulator.scene import compile_scene
from drivers.emulator.sonar import Sonar
from drivers.firing_pattern import LISTENING_LOBE, firing_pattern, sensors
from drivers.messages import Pose

BURST_HZ: Final = 50e3
PERIODS: Final = 16
SAMPLE_S: Final = 1e-6
THRESHOLD: Final = 0.1
DEPTH: Final = 3
RIM: Final = 8_000
"""Points of a post's rim."""
AGREE_M: Final = 1e-3


@dataclass(frozen=True)
class Room:
    """A rectangular room with posts, m, and a pose of the ring in it."""

    corners: tuple[complex, ...]
    posts: tuple[tuple[complex, float], ...]
    pose: Pose

    def world(self) -> WorldConfig:
        """Return the room as the emulator's world."""
        ends = zip(self.corners, self.corners[1:] + self.corners[:1], strict=True)
        return WorldConfig(
            wall=tuple(WallConfig(x1_m=a.real, y1_m=a.imag, x2_m=b.real, y2_m=b.imag) for a, b in ends),
            drum=tuple(DrumConfig(x_m=c.real, y_m=c.imag, radius_m=r) for c, r in self.posts),
            start=StartConfig(),
            acoustics=AcousticsConfig(model="specular"),
        )


def random_room(rng: np.random.Generator) -> Room:
    """Return a room of 2.5 to 5 m a side with up to three posts, the ring .6 m or more from everything."""
    width, depth = rng.uniform(2.5, 5.0, 2)
    corners = (0j, complex(width, 0), complex(width, depth), complex(0, depth))
    place = complex(*rng.uniform((0.6, 0.6), (width - 0.6, depth - 0.6)))
    posts: list[tuple[complex, float]] = []
    for _ in range(rng.integers(0, 4)):
        radius = float(rng.uniform(0.03, 0.3))
        post = complex(*rng.uniform((radius + 0.1,) * 2, (width - radius - 0.1, depth - radius - 0.1)))
        if abs(post - place) > radius + 0.6 and all(abs(post - c) > radius + r for c, r in posts):
            posts.append((post, radius))
    return Room(corners, tuple(posts), Pose(place.real, place.imag, float(rng.uniform(-math.pi, math.pi))))


def measure(rooms: range, tell: Callable[[str], None]) -> dict[str, dict[str, float]]:
    """Return how the emulator's half paths agree with where the detector triggers.

    Parameters
    ----------
    rooms
        Seeds.
    tell
        Called with each step.
    """
    ring = load_robot("ears").ring
    pattern, mounts = firing_pattern(ring), ring.mounts
    plain = ring.model_copy(update={"resolution_m": 0.0, "range_min_m": 0.0})
    half, lobe = math.radians(ring.beam_half_angle_deg), LISTENING_LOBE * math.radians(ring.beam_half_angle_deg)
    differences, only_emulated, only_triggered, round_the_room, late, silent = [], 0, 0, 0, 0, 0
    for seed in rooms:
        tell(f"cross paths: room {seed}")
        room = random_room(np.random.default_rng(seed))
        sonar = Sonar(plain, compile_scene(room.world()), room.world().acoustics, np.random.default_rng(0))
        here = complex(room.pose.x, room.pose.y)
        turn = np.exp(1j * room.pose.theta)
        ears = [(here + turn * complex(m.x_m, m.y_m), room.pose.theta + m.angle_rad) for m in mounts]
        for fired, heard in zip(pattern.masks, pattern.listeners, strict=True):
            found = sonar.fire(room.pose, room.pose.theta, sensors(fired), ring.window_m, sensors(heard))
            for i in sensors(heard):
                arrivals = [
                    arrival
                    for j in sensors(fired)
                    for arrival in arrivals_of(room, (*ears[j], half), (*ears[i], lobe))
                ]
                triggered = trigger_m(arrivals, 2.0 * ring.window_m)
                first = min(arrivals, default=None)
                if first is not None and not first.is_direct and 0.5 * first.way_m < found[i] - AGREE_M:
                    round_the_room += math.isfinite(triggered)
                    continue
                if first is not None and math.isfinite(triggered) and triggered - first.way_m > 2.0 * AGREE_M:
                    late += 1
                    continue
                if math.isfinite(found[i]) and math.isfinite(triggered):
                    differences.append(abs(found[i] - 0.5 * triggered))
                only_emulated += math.isfinite(found[i]) and not math.isfinite(triggered)
                only_triggered += math.isfinite(triggered) and not math.isfinite(found[i])
                silent += not math.isfinite(triggered) and not math.isfinite(found[i])
    apart = np.array(differences)
    return {
        f"{len(rooms)} rooms": {
            "heard by both": float(len(apart)),
            "within 1 mm": float((apart <= AGREE_M).sum()),
            "median mm": float(1e3 * np.median(apart)),
            "greatest of these mm": float(1e3 * apart[apart <= AGREE_M].max(initial=0.0)),
            "farther apart": float((apart > AGREE_M).sum()),
            "emulator only": float(only_emulated),
            "detector only": float(only_triggered),
            "first round the room": float(round_the_room),
            "triggered late": float(late),
            "neither": float(silent),
        }
    }


Ear: TypeAlias = tuple[complex, float, float]
"""A sensor's place, the direction of its axis, and half the width of its beam."""


class Arrival(NamedTuple):
    """A path from one sensor to another: its length, m, its loudness beside a wall's, and what it leads over."""

    way_m: float
    loudness: float
    is_direct: bool
    """Over one surface or the two walls of a corner."""


def arrivals_of(room: Room, emitter: Ear, listener: Ear) -> list[Arrival]:
    """Return each path from one sensor to another that both beams admit."""
    found = []
    walls = list(zip(room.corners, room.corners[1:] + room.corners[:1], strict=True))
    for depth in range(1, DEPTH + 1):
        for order in permutations(range(len(walls)), depth):
            points = _traced([walls[k] for k in order], emitter[0], listener[0])
            if points is not None and _admitted(room, points, emitter, listener, ()):
                way = sum(abs(b - a) for a, b in pairwise(points))
                is_direct = depth == 1 or (depth == 2 and (order[0] - order[1]) % 2 == 1)
                found.append(Arrival(way, 1.0, is_direct))
    for k, (centre, radius) in enumerate(room.posts):
        rim = centre + radius * np.exp(2j * math.pi * np.arange(RIM) / RIM)
        faces = ((emitter[0] - rim) * (rim - centre).conj()).real > 0
        faces &= ((listener[0] - rim) * (rim - centre).conj()).real > 0
        if not faces.any():
            continue
        ways = np.where(faces, abs(rim - emitter[0]) + abs(rim - listener[0]), np.inf)
        point = complex(rim[np.argmin(ways)])
        if _admitted(room, [emitter[0], point, listener[0]], emitter, listener, (k,)):
            way = float(ways.min())
            found.append(Arrival(way, math.sqrt(radius / (radius + 0.5 * way)), is_direct=True))
    return found


def _traced(walls: list[tuple[complex, complex]], emitter: complex, listener: complex) -> list[complex] | None:
    """Return the points of the path that bounces off these walls in turn; None if it misses one."""
    images = [emitter]
    for a, b in walls:
        images.append(a + (b - a) * ((images[-1] - a) / (b - a)).conjugate())
    points = [listener]
    for (a, b), image in zip(walls[::-1], images[:0:-1], strict=True):
        start, end = (points[-1] - a) / (b - a), (image - a) / (b - a)
        if start.imag * end.imag >= 0.0:
            return None
        share = start.real + (end.real - start.real) * start.imag / (start.imag - end.imag)
        if not 0.0 <= share <= 1.0:
            return None
        points.append(a + share * (b - a))
    return [emitter, *points[::-1]]


def _admitted(room: Room, points: list[complex], emitter: Ear, listener: Ear, reflecting: tuple[int, ...]) -> bool:
    """Return whether both beams take the path, and no post stands in its way."""
    for (place, axis, half), towards in ((emitter, points[1]), (listener, points[-2])):
        if abs(np.angle((towards - place) * np.exp(-1j * axis))) > half:
            return False
    for k, (centre, radius) in enumerate(room.posts):
        for a, b in pairwise(points):
            share = min(1.0, max(0.0, ((centre - a) / (b - a)).real))
            if k not in reflecting and abs(a + share * (b - a) - centre) < radius:
                return False
    return True


def trigger_m(arrivals: list[Arrival], farthest_m: float) -> float:
    """Return the way of sound, m, at which the sum of the bursts first passes the threshold; +inf if never."""
    if not arrivals:
        return math.inf
    first = min(arrivals).way_m
    times = first / SOUND_SPEED_M_S + SAMPLE_S * np.arange(-2.0, 2000.0)
    wave = np.zeros(len(times))
    for way, loudness, _ in arrivals:
        since = times - way / SOUND_SPEED_M_S
        wave += np.where((since >= 0) & (since < PERIODS / BURST_HZ), loudness, 0.0) * np.sin(
            2.0 * math.pi * BURST_HZ * since
        )
    above = np.flatnonzero(np.abs(wave) > THRESHOLD)
    if not len(above):
        return math.inf
    k = int(above[0])
    share = (THRESHOLD - abs(wave[k - 1])) / (abs(wave[k]) - abs(wave[k - 1]))
    way = SOUND_SPEED_M_S * float(times[k - 1] + share * SAMPLE_S)
    return way if way <= farthest_m else math.inf
