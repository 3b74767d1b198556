"""The commands of many runs: `experiment` repeats the paper's, `sweep` compares settings, `tune` finds them."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

from config.errors import WRONG_CALL, UserError
from runtime.cli.options import Count, Force, JsonFile, ModelFiles, Sets, Several, UnitsOption, WorldFile
from runtime.simulation.scene_names import SceneName


def experiment(
    name: Literal["hallway", "irregular", "budget", "drift", "canyon"],
    /,
    *,
    method: Literal["paper", "bayes"] = "bayes",
    scene: SceneName | None = None,
    world: WorldFile = None,
    model: ModelFiles = (),
    budget_ms: Annotated[tuple[float, ...], Several] = (0.2, 0.5, 1.0, 2.0, 5.0),
    quanta: Annotated[tuple[float, ...], Several] = (),
    seeds: Count = 1,
    out: str | None = None,
    json: JsonFile = None,
    force: Force = False,
    units: UnitsOption = "ft",
    sets: Sets = (),
) -> int:
    """Repeat an experiment of the paper in virtual time, and print its Table 2.

    Parameters
    ----------
    name
        The simulated hallway, the irregular hallway of the real run, the effect of smaller time budgets for
        perception in a hall of 40 drums, rounds among drums with drifting odometry, or drives to a goal behind a box
        canyon by several sets of schemas.
    method
        How objects are recognised.
    scene
        Instead of driving, give perception the readings of this scene at exact poses.
    budget_ms
        For `budget`: processor time of perception per cycle, ms.
    quanta
        For `budget`: refinement quanta per cycle instead of a time, which makes the table repeatable; 0.1 is one in
        ten cycles.
    seeds
        Repeat with this many seeds, starting at 0.
    out
        Folder for recording, figures and report of the run with seed 0.
    world
        World file to drive in instead of the experiment's own hall.
    model
        Object models to recognise; empty for those of the experiment.
    json
        File for a summary (JSON); None for no file.
    force
        Overwrite files that exist already.
    units
        Units of the printed tables.
    sets
        Single settings, each `path=value`, that override the experiment's.

    Raises
    ------
    UserError
        The options exclude one another, or there are no seeds.
    """
    from runtime.cli.commands.experiment import run_experiment, run_scenes

    sets = (*sets, f"perception.method={method}")
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: must be at least 1", WRONG_CALL)
    if scene is not None and out is not None:
        raise UserError("--scene gives perception readings without a run: there is nothing to record in --out",
                        WRONG_CALL)  # fmt: skip
    if name == "budget":
        from runtime.cli.commands.budget import run_budgets

        if scene is not None or world is not None:
            raise UserError("experiment budget has a hall of its own: leave out --scene and --world", WRONG_CALL)
        return run_budgets(
            sets, budgets_ms=budget_ms, quanta=quanta, models=model, seeds=seeds, json_file=json, force=force,
            units=units,
        )  # fmt: skip
    if name == "drift":
        from runtime.cli.commands.drift import run_drift

        if scene is not None or world is not None or out is not None:
            raise UserError("experiment drift has a hall of its own and records nothing: leave out --scene, --world "
                            "and --out", WRONG_CALL)  # fmt: skip
        return run_drift(sets, models=model, seeds=seeds, json_file=json, force=force, units=units)
    if name == "canyon":
        from runtime.cli.commands.canyon import run_canyons

        if scene is not None or world is not None or out is not None:
            raise UserError("experiment canyon has worlds of its own and records nothing: leave out --scene, --world "
                            "and --out", WRONG_CALL)  # fmt: skip
        return run_canyons(sets, models=model, seeds=seeds, json_file=json, force=force)
    if scene is not None:
        if name != "hallway" or world is not None:
            raise UserError("--scene is a hallway of its own: call `experiment hallway`, without --world", WRONG_CALL)
        return run_scenes(scene, sets, models=model, seeds=seeds, json_file=json, force=force, units=units)
    return run_experiment(
        name, sets, world=world, models=model, seeds=seeds, out=out, json_file=json, force=force, units=units
    )


def sweep(
    study: str,
    /,
    *,
    out: str | None = None,
    scheduler: Annotated[str | None, Parameter(show_default=False)] = None,
    workers: Count | None = None,
    retries: Count = 3,
) -> int:
    """Make the runs of a study on many processes or machines, and compare their settings; needs the extra `sweep`.

    A sweep that was stopped, in whatever way, goes on when it is called again.

    Parameters
    ----------
    study
        Study file, or the name of a shipped one: scenes, worlds or recordings, seeds, and settings to vary.
    out
        Folder for the results: runs.parquet, report.html and a file for each run; by default NAME-sweep.
    scheduler
        Address of a Dask scheduler, as in tcp://host:8786; by default, processes of this machine do the work.
    workers
        Processes on this machine; by default one for each processor.
    retries
        How often a run that ended without a result is tried again.

    Raises
    ------
    UserError
        There are no workers, or the options exclude one another.
    """
    from runtime.cli.commands.sweep import run_sweep

    return run_sweep(study, out=out, scheduler=scheduler, workers=_processes(workers, scheduler), retries=retries)


def tune(
    study: str,
    /,
    *,
    out: str | None = None,
    trials: Count = 60,
    scheduler: Annotated[str | None, Parameter(show_default=False)] = None,
    workers: Count | None = None,
    retries: Count = 3,
) -> int:
    """Find better settings for your recordings or scenes, and write the changes as TOML; needs the extra `tune`.

    What is gained is measured on recordings or seeds that the search has not used. A search that was stopped, in
    whatever way, goes on when it is called again.

    Parameters
    ----------
    study
        Study file, or a folder of recordings.
    out
        Folder for the results: tuned.toml, report.html, trials.csv and a file for each run; by default NAME-tune.
    trials
        Combinations of settings to try.
    scheduler
        Address of a Dask scheduler, as in tcp://host:8786; by default, processes of this machine do the work.
    workers
        Processes on this machine; by default one for each processor.
    retries
        How often a run that ended without a result is tried again.

    Raises
    ------
    UserError
        There are no workers or trials, or the options exclude one another.
    """
    from runtime.cli.commands.tune import run_tune

    if trials == 0:
        raise UserError("--trials 0: must be at least 1", WRONG_CALL)
    return run_tune(
        study, out=out, trials=trials, scheduler=scheduler, workers=_processes(workers, scheduler), retries=retries
    )


def _processes(workers: int | None, scheduler: str | None) -> int:
    """Return how many processes of this machine work.

    Raises
    ------
    UserError
        There are none, or a scheduler has its own.
    """
    import os

    if workers == 0:
        raise UserError("--workers 0: must be at least 1", WRONG_CALL)
    if workers is not None and scheduler is not None:
        raise UserError("--scheduler has workers of its own: leave out --workers", WRONG_CALL)
    return workers or os.cpu_count() or 1
