"""Whether `echolocate tune` finds back what wrong settings lose: ring logs of random halls, as a user has them."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import tomli_w
from rich.table import Table

from config.load import load_settings
from config.robot import RingConfig
from config.study import StudyConfig
from drivers.messages import Pose
from runtime.analysis.export.world_file import world_text
from runtime.batch.runs import expand
from runtime.batch.tuning_study import SENSORS, THRESHOLDS
from runtime.batch.worker import run_one
from runtime.cli.commands.tune import CHANGES, tune
from runtime.recording.ring_log_rows import write_ring_log
from runtime.simulation.scenes import halls, readings

MODEL: Final = "drum"
WRONG_RING: Final = ("ring.beam_half_angle_deg=24.0", "ring.resolution_m=0.2")
WRONG: Final = (
    *WRONG_RING,
    "perception.bayes.report_probability=0.99999",
    "perception.bayes.report_probability_near=0.99999",
)
"""Settings with which no drum is found."""
Rows = dict[str, dict[str, float]]


def write_halls(folder: Path, ring: RingConfig, seeds: Iterable[int]) -> None:
    """Write a ring log of each hall into `logs`, and its true world into `truth`, in a folder."""
    for name in ("logs", "truth"):
        (folder / name).mkdir()
    for seed in seeds:
        (hall,) = halls("halls", seed)
        start = Pose(hall.world.start.x_m, hall.world.start.y_m, 0.0).inverse()
        firings = [replace(one, pose=start.compose(one.pose)) for one in readings(ring, hall, seed * 1000)]
        write_ring_log(folder / "logs" / f"{seed:04}.csv", firings)
        (folder / "truth" / f"{seed:04}.toml").write_text(world_text(hall.world, ()), encoding="utf-8")


def measure(folder: Path, seeds: Iterable[int], *, trials: int, workers: int, blind: bool) -> Rows:
    """Return recall and false objects with the right settings, wrong ones and tuned ones, in all halls.

    Parameters
    ----------
    folder : Path
        Empty; afterwards it contains logs, truth and the results of the search.
    seeds : iterable of int
        The halls; every third is held out from the search.
    trials, workers : int
        As of `echolocate tune`.
    blind : bool
        Search without the truth, for the settings of the ring only.
    """
    write_halls(folder, load_settings("hallway").ring, seeds)
    wrong = WRONG_RING if blind else WRONG
    vary = SENSORS if blind else (*SENSORS, *THRESHOLDS)
    study: dict[str, Any] = {
        "recordings": "logs", "models": [MODEL], "sets": list(wrong),
        "objectives": ["predicted_nat"] if blind else ["f1", "mean_error_m"],
        "vary": [one.model_dump(mode="json", exclude_defaults=True) for one in vary],
    }  # fmt: skip
    if not blind:
        study["truth"] = "truth"
    path = folder / "study.toml"
    path.write_text(tomli_w.dumps(study), encoding="utf-8")
    tune(str(path), out=str(folder / "out"), trials=trials, scheduler=None, workers=workers, retries=1)
    changes = folder / "out" / CHANGES
    found = tomllib.loads(changes.read_text(encoding="utf-8")) if changes.exists() else {}
    tuned = (*wrong, *(f"{name}={json.dumps(value)}" for name, value in flat(found)))
    return {name: recalled(folder, sets) for name, sets in (("right", ()), ("wrong", wrong), ("tuned", tuned))}


def flat(table: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, object]]:
    """Yield dotted paths and values of a TOML table."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from flat(value, f"{path}{key}.")
        else:
            yield path + key, value


def recalled(folder: Path, sets: tuple[str, ...]) -> dict[str, float]:
    """Return how many drums there are, were found, and were found where there is none, searched with and held out."""
    study = StudyConfig(recordings="logs", truth="truth", models=(MODEL,), sets=sets)
    counts = dict.fromkeys((f"{what}_{part}" for part in ("searched", "held_out")
                            for what in ("truth", "found", "false")), 0.0)  # fmt: skip
    for i, run in enumerate(expand(study, folder)):
        part = "held_out" if i % 3 == 2 else "searched"
        row = run_one(run)
        for what in ("truth", "found", "false"):
            counts[f"{what}_{part}"] += row[what]
    return counts


def recovered(rows: Rows, part: str) -> float:
    """Return the share of the recall lost by the wrong settings that the tuned ones find again."""
    right, wrong, tuned = (rows[name][f"found_{part}"] for name in ("right", "wrong", "tuned"))
    return (tuned - wrong) / (right - wrong)


def tuning_table(rows: Rows) -> Table:
    """Return the table."""
    table = Table(title="`echolocate tune` after wrong settings: drums found, and objects that are none")
    for heading in ("settings", "searched: drums", "found", "false", "held out: drums", "found", "false"):
        table.add_column(heading, justify="left" if heading == "settings" else "right")
    for name, counts in rows.items():
        table.add_row(name, *(f"{number:g}" for number in counts.values()))
    shares = [f"{100.0 * recovered(rows, part):.1f} %" for part in ("searched", "held_out")]
    table.add_row("lost recall recovered", "", shares[0], "", "", shares[1], "")
    return table
