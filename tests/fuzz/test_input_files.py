"""Tests that no input file does harm: a clear error or a correct result, in bounded time and memory."""

from __future__ import annotations

import json
import math
import os
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config.load import ConfigError, load_settings, load_world
from drivers.registry import make_device
from runtime.recording.ring_log import RingLogError, read_ring_log
from runtime.recording.ring_log_replay import replay_firings
from tests.fuzz.campaign import KINDS, shipped
from tests.fuzz.hazards import HAZARDS
from tests.fuzz.mutators import mutate

ROOT = Path(__file__).parents[2]
FILES = 80
SOAK_FILES = 20_000
"""For each of the five kinds, 10⁵ in all."""
MEMORY_MAX_MB = 500
SLOW_S = 10.0
"""Limit of a file's CPU time; the slowest takes milliseconds."""


def child(module: str, *arguments: str) -> Any:
    """Run a module in a process of its own and return its JSON output."""
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments], capture_output=True, text=True, timeout=1200, env=env, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


def check_campaign(count: int, seed: int, measured: Callable[[str], None]) -> None:
    """Read `count` mutated files of each kind and check the results."""
    results = child("tests.fuzz.campaign", str(seed), str(count), *KINDS)
    assert [result["kind"] for result in results] == list(KINDS)
    for result in results:
        assert result["failures"] == [], result["kind"]
        assert result["valid"] + result["refused"] == count
        assert min(result["valid"], result["refused"]) > count // 50, (
            "mutations that are never or always detected test nothing"
        )
        assert 0 < result["memory_mb"] < MEMORY_MAX_MB
        assert result["slowest_s"] < SLOW_S
        measured(
            f"{count} mutated files ({result['kind']}): {result['refused']} refused in clear lines, "
            f"{result['valid']} valid, no failure; {result['memory_mb']} MB, "
            f"slowest {result['slowest_s'] * 1e3:.1f} ms"
        )


@pytest.mark.promise("P14")
def test_mutated_files(measured: Callable[[str], None]) -> None:
    check_campaign(FILES, 1, measured)


@pytest.mark.soak
@pytest.mark.promise("P14")
def test_many_mutated_files(measured: Callable[[str], None]) -> None:
    check_campaign(SOAK_FILES, 2, measured)


def check_hazards(scale: str, measured: Callable[[str], None]) -> None:
    """Read every file that is designed to exhaust and check what it cost."""
    costs = child("tests.fuzz.hazards", scale)
    assert set(costs["cases"]) == set(HAZARDS)
    for name, case in costs["cases"].items():
        assert case["failure"] is None, f"{name}: {case['failure']}"
        assert case["cpu_s"] < SLOW_S, f"{name} took {case['cpu_s']} s"
    assert 0 < costs["memory_mb"] < MEMORY_MAX_MB
    slowest = max(costs["cases"], key=lambda name: float(costs["cases"][name]["cpu_s"]))
    measured(
        f"{len(HAZARDS)} files designed to exhaust: {costs['memory_mb']} MB, slowest: {slowest} "
        f"({costs['cases'][slowest]['cpu_s']:.1f} s)"
    )


@pytest.mark.promise("P14")
def test_files_designed_to_exhaust(measured: Callable[[str], None]) -> None:
    """Quadratic parsing and long rows, in files of a tenth of the size: refused or read, and quickly."""
    check_hazards("0.1", measured)


@pytest.mark.soak
@pytest.mark.promise("P14")
def test_large_files_designed_to_exhaust(measured: Callable[[str], None]) -> None:
    """The same at full size: 256 KiB of TOML, and ring logs with a million entries."""
    check_hazards("1", measured)


EXTREMES = (0.0, -0.0, 5e-324, 1e-9, 0.3048, 1.0, -1.0, 1e3, -1e6, 1e9, 1e15, 1e100, 1.7e308, -1.7e308)


def random_log(rng: random.Random, sensors: int) -> str:
    """Return a well-formed ring log with random and extreme values."""

    def cell(share: float, low: float, high: float) -> float:
        value = rng.choice(EXTREMES) if rng.random() < share else rng.uniform(low, high)
        return max(low, value) if low >= 0.0 else value

    share = rng.choice((0.0, 0.02, 0.3))
    rows, t = ["t,x,y,theta," + ",".join(f"r{i:02d}" for i in range(sensors))], 0.0
    for k in range(40):
        t = max(t, cell(share, 0.0, 0.1) + 0.05 * k)
        ranges = [rng.choice(("", "inf", repr(cell(share, 0.0, 5.0)))) for _ in range(sensors)]
        stamp = [t, cell(share, -1.0, 1.0), cell(share, -1.0, 1.0), cell(share, -4.0, 4.0)]
        rows.append(",".join([*map(repr, stamp), *ranges]))
    return "\n".join(rows) + "\n"


@pytest.mark.compiled
@pytest.mark.promise("P14")
@pytest.mark.parametrize("method", ["paper", "bayes"])
@pytest.mark.parametrize("logs", [15, pytest.param(40, marks=pytest.mark.soak)])
def test_random_logs_are_replayed(logs: int, method: str, tmp_path: Path) -> None:
    settings = load_settings("hallway", [f"perception.method={method}"])
    rng = random.Random(14)
    for _ in range(logs):
        path = tmp_path / "log.csv"
        path.write_text(random_log(rng, len(settings.ring.mounts)))
        try:
            summary = replay_firings(settings, read_ring_log(path))
        except RingLogError as error:
            raise AssertionError(path.read_text()) from error
        for seen in summary["objects"]:
            assert all(math.isfinite(v) for v in (seen["x"], seen["y"], seen["theta"], seen["score"])), seen


@pytest.mark.compiled
@pytest.mark.promise("P14")
def test_valid_mutated_worlds_can_be_driven_in(tmp_path: Path) -> None:
    robot = load_settings("hallway")
    rng, seeds, driven = random.Random(15), shipped("worlds"), 0
    path = tmp_path / "world.toml"
    for _ in range(150):
        path.write_bytes(mutate(rng, seeds))
        try:
            world = load_world(path)
        except ConfigError:
            continue
        make_device(robot, world, seed=1).advance(0.3)
        driven += 1
    assert driven > 15
