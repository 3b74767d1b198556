"""Reads mutated input files in a process whose memory is limited and measured.

`python -m tests.fuzz.campaign SEED COUNT KIND…` prints the results as JSON, with the files that caused a failure.
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
from runtime.timing.footprint import peak_mb
from tests.fuzz.mutators import mutate

LINE_MAX = 1000
"""Longest line of an error message, characters."""
MEMORY_DISK = Path("/dev/shm")
"""A memory file system; on a disk, creating the files would take most of the time."""
ADDRESS_SPACE = 4 << 30
"""Limit of the process's memory, bytes."""

RING_LOG = b"t,x,y,theta,r00,r01,r02\n" + b"".join(
    b"%.2f,%.3f,-0.25,1.5e-1,%.5f,,inf\n" % (0.05 * k, 0.01 * k, 1.0 + 0.03048 * k) for k in range(20)
)
RING_LOG_YAW = RING_LOG.replace(b"theta", b"theta,ring_yaw").replace(b"1.5e-1,", b"0.15,0.0,")


def shipped(kind: Any) -> list[bytes]:
    """Return the shipped configuration files of a kind."""
    folder = Path(__file__).parents[2] / "config" / kind
    return [(folder / f"{name}.toml").read_bytes() for name in list_shipped(kind)]


def read_whole_ring_log(path: Path) -> None:
    last = -math.inf
    for firing in read_ring_log(path):
        assert firing.robot_s >= last
        pose = firing.pose
        assert all(map(math.isfinite, (firing.robot_s, pose.x, pose.y, pose.theta, firing.ring_yaw)))
        assert not (firing.ranges_m < 0.0).any()
        last = firing.robot_s


def read_robot(path: Path) -> None:
    ring = load_robot(path).ring
    masks = wire_pattern(ring).masks
    assert 0 < len(masks) <= 24
    assert all(0 < mask < 1 << len(ring.mounts) for mask in masks)


def read_model(path: Path) -> None:
    assert all(math.hypot(*vertex) <= 100.0 for vertex in load_model(path).vertices_m)


def read_world(path: Path) -> None:
    world = load_world(path)
    assert all(abs(value) <= 10_000.0 for drum in world.drum for value in (drum.x_m, drum.y_m, drum.radius_m))


def read_run(path: Path) -> None:
    loaded = load_any(path)
    if isinstance(loaded, Settings):
        wire_pattern(loaded.ring)


KINDS: dict[str, tuple[str, list[bytes], Callable[[Path], None]]] = {
    "ring log": ("log.csv", [RING_LOG, RING_LOG_YAW], read_whole_ring_log),
    "world": ("world.toml", shipped("worlds"), read_world),
    "model": ("model.toml", shipped("models"), read_model),
    "robot": ("robot.toml", shipped("robots"), read_robot),
    "run": ("run.toml", [*shipped("runs"), *shipped("robots")], read_run),
}


def error_message(read: Callable[[Path], None], path: Path) -> str | None:
    """Return the error message for the file, or None if it is valid; let all but user errors propagate."""
    try:
        read(path)
    except (ConfigError, RingLogError, FiringError) as error:
        return str(error)
    return None


def campaign(kind: str, seed: int, count: int) -> dict[str, Any]:
    """Return the counts, failures and costs of reading `count` mutated files of a kind."""
    name, seeds, read = KINDS[kind]
    rng = random.Random(f"{kind} {seed}")
    result: dict[str, Any] = {
        "kind": kind,
        "files": count,
        "valid": 0,
        "refused": 0,
        "slowest_s": 0.0,
        "failures": [],
    }
    start_s = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=MEMORY_DISK if MEMORY_DISK.is_dir() else None) as folder:
        path = Path(folder) / name
        for _ in range(count):
            data = mutate(rng, seeds)
            path.write_bytes(data)
            file_s = time.process_time()
            try:
                message = error_message(read, path)
                result["refused" if message is not None else "valid"] += 1
                for line in () if message is None else message.split("\n"):
                    assert line.isprintable(), f"not printable: {line!r}"
                    assert 0 < len(line) < LINE_MAX, f"line too long: {line[:200]!r}"
            except Exception as error:  # noqa: BLE001 - any other exception is a failure
                result["failures"].append([f"{type(error).__name__}: {error}"[:400], data[:4000].decode("latin-1")])
                if len(result["failures"]) >= 5:
                    break
            result["slowest_s"] = max(result["slowest_s"], time.process_time() - file_s)
    result["files_per_s"] = round(count / (time.perf_counter() - start_s))
    result["memory_mb"] = round(peak_mb() or 0.0)
    return result


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
    sys.stdout.write(json.dumps([campaign(kind, int(sys.argv[1]), int(sys.argv[2])) for kind in sys.argv[3:]]))
