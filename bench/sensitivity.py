"""How much each tuned number of perception matters: what figures become with the number changed.

`python -m bench sensitivity` gives each number at the top of perception's modules other values, one at a time (0.7
and 1.4 times it, one more and one less for small counts), lets a fixed set of drives be perceived, each in a process
of its own, and writes a line of JSON for each. A number that changes nothing can leave, with the branch that needs
it; a run that fails says that the number belongs to the structure.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Final, TypeAlias

import numpy as np
import orjson
from cyclopts import App, Parameter

from bench.varied_source import TunedNumber, kernel_digests, renew_kernels, tuned_numbers, vary
from config.errors import DONE
from runtime.support.kernel_cache import use_kernel_cache

Figures: TypeAlias = dict[str, float]

TIMEOUT_S: Final = 900.0
"""A process that takes longer is one that failed."""
HALLS: Final = ("jit10", "noisy", "halls", "boxes_45")
ROOMS: Final = (1200, 1201)
STEP_FT: Final = 0.2
LIES: Final = ("frozen", "silent", "random", "turned 180")
NEAR_M: Final = 0.1
"""An echo is explained by a wall or a corner this near."""

app = App(help="Change each tuned number of perception and measure what that changes.")


@dataclass(frozen=True, slots=True)
class Outcome:
    """What becomes of the figures with one number changed.

    Attributes
    ----------
    number
        The number, with its shipped value.
    value
        The value tried.
    changed : dict
        The figures that differ, each with its shipped and its new value.
    failed : str or None
        The last line of what a process that failed said.
    """

    number: TunedNumber
    value: int | float
    changed: dict[str, tuple[float, float]]
    failed: str | None


def hall_figures(scene: str, seed: int) -> Figures:
    """Return drums or boxes found, false ones, and the mean error (ft) in the halls of a scene."""
    from typing import cast

    from config.load import load_settings
    from config.units import FOOT_M
    from runtime.simulation.open_loop import run_scene, summarise_scene
    from runtime.simulation.scene_names import SceneName

    name = cast("SceneName", scene)
    settings = load_settings("hallway", ['models=["semicircle", "box"]'] if "boxes" in scene else [])
    outcome = summarise_scene(name, run_scene(settings, name, seed), settings.models)
    rows = [row["error"] for row in (*outcome["drums"], *outcome["boxes"])]
    mean = outcome["mean_error"]
    return {
        f"{scene}: found": sum(error is not None for error in rows),
        f"{scene}: false": outcome["false"],
        f"{scene}: mean error, ft": math.nan if mean is None else mean / FOOT_M,
    }


def room_figures() -> Figures:
    """Return the shares of walls and corners found and of false ones in random rooms."""
    from typing import get_args

    from bench.trials.furnished_rooms import ACOUSTICS, furnished_room
    from bench.trials.wall_trials import figures, try_room
    from config.load import load_settings
    from config.units import FOOT_M
    from perception.localization.room.expected_ranges import Reflection

    settings, found = load_settings("hallway"), Figures()
    for reflection in get_args(Reflection):
        acoustics = ACOUSTICS.model_copy(update={"model": reflection})
        rooms = [try_room(settings, furnished_room(seed, acoustics), seed, STEP_FT * FOOT_M) for seed in ROOMS]
        row = asdict(figures(rooms))
        for name in ("found", "false", "offset_mean_m", "corners_found", "false_corners"):
            found[f"{reflection} rooms: {name}"] = row[name]
    return found


def lie_figures() -> Figures:
    """Return how soon each kind of lie is named, s, and how fast the robot then touches something, m/s."""
    from bench.lies import run_trial

    found = Figures()
    for kind in LIES:
        trial = run_trial("denning", "hallway", kind, 0, 0)
        found[f"{kind}: named after, s"] = math.nan if trial.named_s is None else trial.named_s
        found[f"{kind}: contact, m/s"] = trial.contact_m_s
    return found


def log_figures(log: Path, robot: Path) -> Figures:
    """Return how many walls, corners and objects are reported after a ring log, and the walls' length, m."""
    from bench.trials.wall_trials import Heard, recognise, reported_walls
    from config.load import load_settings
    from runtime.recording.ring_log import read_ring_log

    settings = load_settings("hallway", robot=str(robot))
    heard = Heard(tuple(read_ring_log(log)), (), (), (), ())
    seen = recognise(settings, heard).labelled_objects()
    walls = reported_walls(seen)
    return {
        f"{log.stem}: walls, m": sum(wall.length_m for wall in walls),
        f"{log.stem}: other objects": len(seen) - len(walls),
    }


def real_figures(drive: Path) -> Figures:
    """Return the share of echoes that a reported wall or corner explains in a drive with its truth.

    The folder has ring.csv and robot.toml as the product reads them, and, a row a firing, the true poses (truth.csv:
    x, y, theta) and the true bearings of the echoes (bearings.csv, rad; empty where there was none).
    """
    from dataclasses import replace

    from bench.trials.wall_trials import Heard, recognise, reported_corners, reported_walls
    from config.load import load_settings
    from drivers.messages import Pose
    from runtime.recording.ring_log import read_ring_log

    settings = load_settings("hallway", robot=str(drive / "robot.toml"))
    truth = np.genfromtxt(drive / "truth.csv", delimiter=",", names=True)
    poses = [Pose(*row) for row in np.column_stack([truth[k] for k in ("x", "y", "theta")]).tolist()]
    firings = [
        replace(firing, pose=pose, ring_yaw=pose.theta)
        for firing, pose in zip(read_ring_log(drive / "ring.csv"), poses, strict=True)
    ]
    bearings = np.genfromtxt(drive / "bearings.csv", delimiter=",", skip_header=1)
    seen = recognise(settings, Heard(tuple(firings), (), (), (), ())).labelled_objects()
    ranges = np.array([firing.ranges_m for firing in firings])
    rows, sensors = np.nonzero(np.isfinite(ranges) & np.isfinite(bearings))
    angles = np.array([pose.theta for pose in poses])[rows] + bearings[rows, sensors]
    at = np.array([(pose.x, pose.y) for pose in poses])[rows]
    echoes = at + ranges[rows, sensors, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    distance = np.full(len(echoes), np.inf)
    for wall in reported_walls(seen):
        distance = np.minimum(distance, wall.distance(echoes))
    for corner in reported_corners(seen):
        distance = np.minimum(distance, np.hypot(*(echoes - (corner.x, corner.y)).T))
    return {f"{drive.name}: explained": float((distance < NEAR_M).mean())}


def all_figures(logs: Mapping[Path, Path], drives: tuple[Path, ...]) -> Figures:
    """Return all figures; `logs` are ring logs with their robot files, `drives` folders of `real_figures`."""
    found = Figures()
    for seed, scene in enumerate(HALLS):
        found |= hall_figures(scene, seed)
    found |= room_figures() | lie_figures()
    for log, robot in logs.items():
        found |= log_figures(log, robot)
    for drive in drives:
        found |= real_figures(drive)
    return found


@app.command
def one(
    shipped: Path,
    module: str = "",
    name: str = "",
    value: float = 0.0,
    *,
    count: bool = False,
    logs: tuple[Path, ...] = (),
    drives: tuple[Path, ...] = (),
) -> int:
    """Print the figures with one number changed, as JSON; without one, write what kernels are compiled from.

    Parameters
    ----------
    shipped
        File of what the shipped kernels are compiled from.
    module, name, value
        The number.
    count
        Whether it is a whole one.
    logs, drives
        As of the command itself.
    """
    use_kernel_cache()
    if module:
        vary(TunedNumber(module, name, int(value) if count else value))
    if module:
        renew_kernels(orjson.loads(shipped.read_bytes()))
    else:
        shipped.write_bytes(orjson.dumps(kernel_digests()))
    robots = {log: log.with_suffix(".toml") for log in logs}
    sys.stdout.write(orjson.dumps(all_figures(robots, drives)).decode() + "\n")
    return DONE


def outcomes(
    numbers: list[TunedNumber], logs: tuple[Path, ...], drives: tuple[Path, ...], processes: int
) -> Iterator[Outcome]:
    """Yield what becomes of the figures with each number changed."""
    options = [*(f"--logs={log}" for log in logs), *(f"--drives={drive}" for drive in drives)]

    def run(shipped: Path, *arguments: str) -> tuple[Figures, str | None]:
        program = [sys.executable, "-m", "bench.sensitivity", "one", str(shipped), *arguments, *options]
        try:
            done = subprocess.run(program, capture_output=True, check=False, timeout=TIMEOUT_S)
        except subprocess.TimeoutExpired:
            return {}, f"it took more than {TIMEOUT_S:.0f} s"
        if done.returncode:
            return {}, done.stderr.decode(errors="replace").strip().rpartition("\n")[2] or "no message"
        figures: Figures = orjson.loads(done.stdout)
        return figures, None

    with TemporaryDirectory() as folder:
        shipped = Path(folder) / "kernels.json"
        before, failed = run(shipped)
        if failed is not None:
            raise RuntimeError(f"the shipped numbers could not be measured: {failed}")

        def vary_one(task: tuple[TunedNumber, int | float]) -> Outcome:
            number, value = task
            whole = ["--count"] if isinstance(value, int) else []
            after, failed = run(shipped, number.module, number.name, f"--value={value!r}", *whole)
            changed = {key: (before[key], after[key]) for key in after if after[key] != before[key]}
            return Outcome(number, value, changed, failed)

        with ThreadPoolExecutor(processes) as pool:
            yield from pool.map(vary_one, [(number, value) for number in numbers for value in number.variants()])


@app.default
def main(
    package: Annotated[str, Parameter(help="Package of perception whose numbers are changed.")] = "perception",
    *,
    only: Annotated[str, Parameter(help="Only names that contain this text.")] = "",
    logs: Annotated[tuple[Path, ...], Parameter(help="Ring logs, each with a robot file beside it.")] = (),
    drives: Annotated[tuple[Path, ...], Parameter(help="Folders of drives with the truth of every echo.")] = (),
    processes: Annotated[int, Parameter(help="How many at a time.")] = os.cpu_count() or 1,
) -> int:
    """Print a line of JSON for each other value of each number, and at the end the numbers that change nothing."""
    use_kernel_cache()
    numbers = [number for number in tuned_numbers(package) if only in number.name]
    idle = set(numbers)
    for outcome in outcomes(numbers, logs, drives, processes):
        if outcome.changed or outcome.failed is not None:
            idle.discard(outcome.number)
        row = {**asdict(outcome), "number": outcome.number._asdict()}
        sys.stdout.write(orjson.dumps(row).decode() + "\n")
        sys.stdout.flush()
    for number in sorted(idle):
        sys.stderr.write(f"no figure depends on {number.module}.{number.name} = {number.value:g}\n")
    return DONE


if __name__ == "__main__":
    sys.exit(app())
