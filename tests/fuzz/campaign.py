"""Harmed input files against what reads them, in a process of its own whose memory is limited and measured.

`python -m tests.fuzz.campaign KIND SEED COUNT` prints what happened as JSON; a file that hurts is printed with it.
"""

from __future__ import annotations

import json
import math
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from config.files import list_shipped
from config.load import ConfigError, load_any, load_model, load_robot, load_world
from config.settings import Settings
from drivers.denning.wire_units import wire_pattern
from drivers.firing_pattern import FiringError
from runtime.recording.ring_log import RingLogError, read_ring_log
from tests.fuzz.mutators import mutated

LINE_MAX = 1000
MEMORY_DISK = Path("/dev/shm")
"""Most of the time would otherwise go into making files."""
ADDRESS_SPACE = 4 << 30
"""A file that would fill the machine fills no more than this."""

RING_LOG = b"t,x,y,theta,r00,r01,r02\n" + b"".join(
    b"%.2f,%.3f,-0.25,1.5e-1,%.5f,,inf\n" % (0.05 * k, 0.01 * k, 1.0 + 0.03048 * k) for k in range(20)
)
RING_LOG_YAW = RING_LOG.replace(b"theta", b"theta,ring_yaw").replace(b"1.5e-1,", b"0.15,0.0,")


def shipped(kind: Any) -> list[bytes]:
    folder = Path(__file__).parents[2] / "config" / kind
    return [(folder / f"{name}.toml").read_bytes() for name in list_shipped(kind)]


def take_ring_log(path: Path) -> None:
    last = -math.inf
    for firing in read_ring_log(path):
        assert firing.robot_s >= last
        pose = firing.pose
        assert all(map(math.isfinite, (firing.robot_s, pose.x, pose.y, pose.theta, firing.ring_yaw)))
        assert not (firing.ranges_m < 0.0).any()
        last = firing.robot_s


def take_robot(path: Path) -> None:
    ring = load_robot(path).ring
    masks = wire_pattern(ring).masks
    assert 0 < len(masks) <= 24
    assert all(0 < mask < 1 << len(ring.mounts) for mask in masks)


def take_model(path: Path) -> None:
    assert all(math.hypot(*vertex) <= 100.0 for vertex in load_model(path).vertices_m)


def take_world(path: Path) -> None:
    world = load_world(path)
    assert all(abs(value) <= 10_000.0 for drum in world.drum for value in (drum.x_m, drum.y_m, drum.radius_m))


def take_run(path: Path) -> None:
    taken = load_any(path)
    if isinstance(taken, Settings):
        wire_pattern(taken.ring)


KINDS: dict[str, tuple[str, list[bytes], Callable[[Path], None]]] = {
    "ring log": ("log.csv", [RING_LOG, RING_LOG_YAW], take_ring_log),
    "world": ("world.toml", shipped("worlds"), take_world),
    "model": ("model.toml", shipped("models"), take_model),
    "robot": ("robot.toml", shipped("robots"), take_robot),
    "run": ("run.toml", [*shipped("runs"), *shipped("robots")], take_run),
}


def complaint_of(take: Callable[[Path], None], path: Path) -> str | None:
    """Return what is said of the file, None where it is good; anything that is not for a user comes out raised."""
    try:
        take(path)
    except (ConfigError, RingLogError, FiringError) as error:
        return str(error)
    return None


def campaign(kind: str, seed: int, count: int) -> dict[str, Any]:
    name, seeds, take = KINDS[kind]
    rng = random.Random(f"{kind} {seed}")
    told: dict[str, Any] = {"kind": kind, "files": count, "good": 0, "refused": 0, "slowest_s": 0.0, "hurt": []}
    begun_s = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as folder:
        path = Path(folder) / name
        for _ in range(count):
            data = mutated(rng, seeds)
            path.write_bytes(data)
            file_s = time.process_time()
            try:
                said = complaint_of(take, path)
                told["refused" if said is not None else "good"] += 1
                for line in () if said is None else said.split("\n"):
                    assert line.isprintable(), f"not printable: {line!r}"
                    assert 0 < len(line) < LINE_MAX, f"not a line: {line[:200]!r}"
            except Exception as error:  # noqa: BLE001 - that is what is looked for
                told["hurt"].append([f"{type(error).__name__}: {error}"[:400], data[:4000].decode("latin-1")])
                if len(told["hurt"]) >= 5:
                    break
            told["slowest_s"] = max(told["slowest_s"], time.process_time() - file_s)
    told["files_per_s"] = round(count / (time.perf_counter() - begun_s))
    told["memory_mb"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    return told


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    sys.stdout.write(json.dumps(campaign(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
