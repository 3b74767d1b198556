"""A synthetic run as the page sees it: the paper's hall, and a robot that drives through it.

The tests of the page need frames that they can foretell, of any size, and no robot.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from drivers.registry import driver_names

FOOT: Final = 0.3048
PERIOD_S: Final = 0.05
START: Final = (-6 * FOOT, 0.0)
DRUMS: Final = tuple((x * FOOT - START[0], y * FOOT) for y in (4, -4) for x in (1, 4, 7))
"""In the odometry's frame."""
RADIUS: Final = FOOT
NO_PLACES: Final[dict[str, Any]] = {
    "type": "places", "frame": "odom", "place": [], "no_go_line": [], "no_go_area": [], "speed_area": []
}  # fmt: skip
PHASES: Final = ("gather", "perceive", "decide", "command", "refine", "observers")


def parameter(path: str, kind: str, value: object, low: float | None = None, high: float | None = None,
              choices: list[str] | None = None, help_: str = "") -> dict[str, Any]:  # fmt: skip
    """Return a parameter as the session message lists it."""
    return {"path": path, "label": path.split(".")[-1].replace("_", " "), "value": value, "low": low, "high": high,
            "kind": kind, "choices": choices, "optional": False, "help": help_}  # fmt: skip


PARAMETERS: Final = (
    parameter("behaviors.avoid_static_obstacle.avoid_obstacle_gain", "float", 1.0, 0.0, 100.0),
    parameter("behaviors.avoid_static_obstacle.avoid_obstacle_sphere_m", "float", 0.6, 0.0, 100.0,
              help_="S: obstacles farther away than this do not matter."),
    parameter("behaviors.move_ahead.move_ahead_gain", "float", 1.0, 0.0, 100.0),
    parameter("cycle.perception_budget_s", "float", 0.005, 0.0, 1.0,
              help_="Time perception may take in a cycle; refinement stops there and resumes in the next."),
    parameter("perception.clusters.threshold_m", "float", 0.4572, 0.0, 100.0,
              help_="T: a segment farther than this from every cluster's centre founds a new cluster."),
    parameter("perception.bayes.quanta_per_firing", "int", 2, 1, 1000),
    parameter("perception.map.age_max_s", "float", 120.0, 0.0, 1e6, help_="Segments leave the map at this age."),
    parameter("perception.relaxation.gamma", "float", 2.0, 0.0, 100.0,
              help_="γ: sphere_i = γ times the length of model segment i."),
    parameter("ring.firing.preset", "choice", "octets", choices=["octets", "quadrants", "all"]),
)  # fmt: skip


def greeting(role: str = "control", **changes: Any) -> dict[str, Any]:
    """Return the session message, the first one that a server sends."""
    angles = [math.radians(15.0 * i) for i in range(24)]
    turn = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)
    drum = [[round(RADIUS * math.cos(a), 6), round(RADIUS * math.sin(a), 6)] for a in turn]
    half = RADIUS
    return {
        "type": "session", "version": "1.0.0", "role": role, "name": "denning", "emulated": True,
        "units": "ft", "client": 1, "has_token": True, "robots": [], "places": NO_PLACES,
        "ring": {"mounts": [[0.381 * math.cos(a), 0.381 * math.sin(a), a] for a in angles],
                 "turning": [], "half_angle": math.radians(12.0), "range_min": 0.1524, "range_max": 7.7724},
        "body": {"radius": 0.381, "speed_max": 0.5, "turn_max": 1.0},
        "models": [{"name": "drum", "vertices": drum, "closed": True, "arc_radius_m": RADIUS},
                   {"name": "box", "vertices": [[half, -half], [half, half], [-half, half], [-half, -half]],
                    "closed": True, "arc_radius_m": None}],
        "radii": {"edge": 0.0, "post": 0.1, "barrel": 0.67},
        "truth": {"drums": [[x, y, RADIUS] for x, y in DRUMS], "walls": [], "polygons": []},
        "known_room": {"drums": [], "walls": [[-2.0, -2.0, 4.0, -2.0]], "polygons": []},
        "missions": [{"name": "patrol", "about": "Drives round."}, {"name": "wander", "about": ""}],
        "drivers": list(driver_names()),
        "parameters": [dict(p) for p in PARAMETERS], "budget_s": 0.005, "period_s": PERIOD_S,
    } | changes  # fmt: skip


@dataclass
class Hall:
    """The state of the run in cycle n.

    Parameters
    ----------
    segments, objects
        How many there are when all are known; beyond the six drums they stand in rows along the hall.
    """

    segments: int = 150
    objects: int = 6
    seed: int = 1
    moving: bool = True
    walls: tuple[tuple[float, float, float, float], ...] = ()
    """Ends of walls, which have the numbers from 101 on."""
    places: list[tuple[float, float]] = field(init=False)
    _shape: list[list[float]] = field(init=False)

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        more = [(0.9 * (i % 9) - 1.0, 2.4 + 0.9 * (i // 9)) for i in range(max(0, self.objects - len(DRUMS)))]
        self.places = [*DRUMS, *more][: self.objects]
        self._shape = []
        for number in range(1, self.segments + 1):
            x, y = self.places[number % len(self.places)]
            inward = -math.copysign(math.pi / 2, y) if y else 0.0
            angle = inward + rng.uniform(-1.1, 1.1)
            away = RADIUS + rng.normal(0.0, 0.02)
            length = rng.uniform(0.05, 0.16)
            cx, cy = x + away * math.cos(angle), y + away * math.sin(angle)
            dx, dy = -0.5 * length * math.sin(angle), 0.5 * length * math.cos(angle)
            self._shape.append([cx - dx, cy - dy, cx + dx, cy + dy, angle])

    def pose(self, cycle: int) -> list[float]:
        """Return the pose of the robot."""
        s = min(0.3 * cycle * PERIOD_S, 4.2) if self.moving else 0.0
        return [s, 0.06 * math.sin(1.4 * s), 0.08 * math.cos(1.4 * s)]

    def known(self, cycle: int) -> int:
        """Return the number of segments made so far."""
        return min(self.segments, 30 + cycle) if self.moving else self.segments

    def segment(self, number: int, t: float) -> list[float]:
        """Return a segment in wire form; the first ones are the oldest."""
        return [number, *self._shape[number - 1], max(0.0, t)]

    def ranges(self, pose: list[float]) -> list[float]:
        """Return the range of every sensor; −1 without an echo."""
        out = []
        for i in range(24):
            a = math.radians(15.0 * i)
            px, py = pose[0] + 0.381 * math.cos(a), pose[1] + 0.381 * math.sin(a)
            best = -1.0
            for x, y in self.places:
                away = math.hypot(x - px, y - py)
                off = abs(math.remainder(math.atan2(y - py, x - px) - a, 2.0 * math.pi))
                reach = away - RADIUS
                if off < math.radians(12.0) + math.asin(min(1.0, RADIUS / away)) and 0.0 < reach < 7.7:
                    best = reach if best < 0.0 else min(best, reach)
            out.append(round(best, 3))
        return out

    def seen(self, cycle: int) -> list[dict[str, Any]]:
        """Return the recognised objects."""
        out = []
        for i, (x, y) in enumerate(self.places):
            spread = 0.004 + 0.0006 * i
            probability = 0.62 if i == 5 and cycle % 400 < 40 and self.moving else 0.97 + 0.003 * (i % 10)
            out.append({
                "number": i + 1, "model": "drum" if i < 6 or i % 5 else "wall", "x": x + 0.01, "y": y - 0.01,
                "theta": 0.0, "sigma": spread, "sigma_theta": None,
                "covariance": [spread**2, 0.4 * spread**2, 0.6 * spread**2],
                "probability": min(0.999, probability), "support": 40 + i, "score": 0.9, "confirmed": False,
                "placed": False, "ends": None,
            })  # fmt: skip
        for i, (x1, y1, x2, y2) in enumerate(self.walls):
            out.append({
                "number": 101 + i, "model": "wall", "x": (x1 + x2) / 2, "y": (y1 + y2) / 2,
                "theta": math.atan2(y2 - y1, x2 - x1), "sigma": 0.01, "sigma_theta": 0.004,
                "covariance": [0.1, 0.0, 0.0001],
                "probability": 0.98, "support": 60, "score": 0.98, "confirmed": False, "placed": False,
                "ends": [x1, y1, x2, y2],
            })  # fmt: skip
        return out

    def frame(self, cycle: int) -> dict[str, Any]:
        """Return the part of a frame that all clients share: all but the role and the new segments."""
        rng = np.random.default_rng([self.seed, cycle])
        pose = self.pose(cycle)
        busy = 2500.0 + 1800.0 * math.sin(cycle / 9.0) ** 2
        share = dict(zip(PHASES, (180.0, 620.0, 160.0, 90.0, busy, 240.0), strict=True))
        phases = {name: float(round(v * rng.uniform(0.85, 1.15))) for name, v in share.items()}
        missed = cycle // 170
        clusters = [[x, y - math.copysign(0.25, y), 0.5, 0.22, 0.02 * i, 14 + i]
                    for i, (x, y) in enumerate(self.places)]  # fmt: skip
        return {
            "cycle": cycle, "robot_s": round(cycle * PERIOD_S, 3), "host_s": round(cycle * PERIOD_S, 3), "pose": pose,
            "ring_yaw": 0.0, "twist": [0.3 if self.moving else 0.0, 0.02], "flags": [],
            "firing": [(cycle + 3 * k) % 24 for k in range(8)],
            "ranges": self.ranges(pose), "age": [0.05 * ((i - cycle) % 3) for i in range(24)],
            "clusters": clusters, "objects": self.seen(cycle),
            "vectors": [["move_ahead", 1.0, 0.0], ["avoid_static_obstacle", -0.25, 0.3], ["sum", 0.75, 0.3]],
            "phases": phases, "cycle_us": round(sum(phases.values())), "late_us": round(abs(rng.normal(120, 60))),
            "localized": {"pose": pose, "covariance": [4e-4, 1e-4, 2e-4, 1e-4], "status": "tracking",
                          "probability": 0.9, "frame": [0.05, -0.02, 0.03]},
            "missed": missed, "late": cycle // 90, "quanta": 3, "refinement": "budget",
            "link": {"frames": 24 * cycle, "bad": 1 if cycle > 60 else 0, "lost": 0},
            "sensors": [[17, "failing", "hears less than its neighbours"]], "waiting": 0, "valley": None,
        }  # fmt: skip
