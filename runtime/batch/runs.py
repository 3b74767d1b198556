"""The runs of a study: every combination of its settings with every scene, world or recording and every seed.

A run is named by a digest of all that its result depends on. So a sweep that was stopped goes on where it was, and
one whose study has grown makes only what is new.
"""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

from config.files import ConfigError, did_you_mean
from config.load import load_settings, load_world
from config.settings import Settings
from config.study import StudyConfig, Value
from runtime import VERSION
from runtime.simulation.scene_names import SceneName

RunKind: TypeAlias = Literal["scene", "world", "recording"]

RUNS_MAX: Final = 1_000_000
KEY_DIGITS: Final = 24
EDGE_BYTES: Final = 65536
"""A recording is known by its name, its length, and so many bytes at its beginning and its end."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run of a study, as a worker gets it."""

    key: str
    kind: RunKind
    subject: str
    """Name of the scene or world, or path of the recording."""
    seed: int | None
    settings: str
    """All settings (JSON); a recording (MCAP) keeps its own instead."""
    overrides: tuple[str, ...] = ()
    """What differs from the settings in a recording (MCAP), as after ``--set``."""
    truth: str | None = None
    """The true world of a recording (JSON)."""
    predicts: bool = False
    """Whether readings of a recording are withheld, and then predicted."""
    varied: Mapping[str, Value] = field(default_factory=dict)
    """The varied settings."""


def expand(study: StudyConfig, base: Path, varied: Sequence[Mapping[str, Value]] | None = None) -> list[Run]:
    """Return the runs of a study, each once, settings after settings.

    Parameters
    ----------
    study : StudyConfig
        The study.
    base : Path
        Its folder, to which paths in it are relative.
    varied : sequence of mapping, optional
        Values of settings by name; by default every combination of the study.

    Raises
    ------
    ConfigError
        A scene, a file or a value is invalid, or there are too many runs or none.
    """
    subjects = list(_subjects(study, base))
    varied = combinations(study) if varied is None else varied
    seeds = [None] if study.recordings is not None else range(study.first_seed, study.first_seed + study.seeds)
    if (count := len(varied) * len(subjects) * len(seeds)) > RUNS_MAX:
        raise ConfigError(f"the study has {count:,} runs, at most {RUNS_MAX:,} are allowed: leave out some values")
    truths = _truths(study, base, [subject for _, subject, _ in subjects])
    predicts = "predicted_nat" in study.objectives
    runs: dict[str, Run] = {}
    for values in varied:
        overrides = tuple(f"{setting}={json.dumps(value)}" for setting, value in values.items())
        settings: dict[str | None, str] = {}
        for kind, subject, identity in subjects:
            world = _path(subject, base) if kind == "world" else None
            if world not in settings:
                settings[world] = _settings(study, base, overrides, world).model_dump_json()
            for seed in seeds:
                changes = (*study.sets, *overrides) if kind == "recording" else ()
                inputs = [VERSION, kind, identity, seed, settings[world], changes, truths[subject], predicts]
                key = hashlib.sha256(json.dumps(inputs).encode()).hexdigest()[:KEY_DIGITS]
                run = Run(key, kind, subject, seed, settings[world], changes, truths[subject], predicts, values)
                runs.setdefault(key, run)
    return list(runs.values())


def _settings(study: StudyConfig, base: Path, overrides: tuple[str, ...], world: str | None) -> Settings:
    """Return the settings of a run; a drive ends with its leg, as in the experiment.

    Raises
    ------
    UserError
        They are invalid, the leg has no end, or the robot would not see where it drives.
    """
    settings = load_settings(
        _path(study.config, base),
        (*study.sets, *overrides),
        robot=None if study.robot is None else _path(study.robot, base),
        world=world,
        models=[_path(model, base) for model in study.models],
    )
    if world is None:
        return settings
    from runtime.simulation.evaluation import stop_at_leg_end
    from runtime.support.pattern_check import refuse_undrivable

    refuse_undrivable(settings)
    return stop_at_leg_end(settings)


def combinations(study: StudyConfig) -> list[dict[str, Value]]:
    """Return every combination of the varied settings, the values of the last changing fastest."""
    names = [vary.setting for vary in study.vary]
    return [
        dict(zip(names, values, strict=True)) for values in itertools.product(*(vary.values for vary in study.vary))
    ]


def _subjects(study: StudyConfig, base: Path) -> Iterator[tuple[RunKind, str, str]]:
    """Yield kind, name and identity of all that is run with each setting.

    Raises
    ------
    ConfigError
        There is no such scene, or no recording.
    """
    known = get_args(SceneName)
    for scene in study.scenes:
        if scene not in known:
            raise ConfigError(
                f'scene "{scene}": no such scene{did_you_mean(scene, known)}; known scenes: {", ".join(known)}'
            )
        yield "scene", scene, scene
    for world in study.worlds:
        yield "world", world, ""  # it is part of the settings
    if study.recordings is None:
        return
    folder = base / study.recordings
    files = sorted(path for path in folder.rglob("*") if path.suffix in {".mcap", ".csv"} and path.is_file())
    if not files:
        raise ConfigError(f"recordings {folder}: no recording (.mcap) or ring log (.csv) there; name their folder")
    whole = folder.resolve()  # of the folder alone: a link in it may lead to a file elsewhere
    for path in files:
        yield "recording", str(whole / path.relative_to(folder)), _identity(path, folder)


def _truths(study: StudyConfig, base: Path, subjects: Iterable[str]) -> dict[str, str | None]:
    """Return the true world (JSON) of each recording; None where the study names none.

    Raises
    ------
    ConfigError
        One cannot be read or is invalid.
    """
    if study.truth is None or study.recordings is None:
        return dict.fromkeys(subjects)
    if not (base / study.truth).is_dir():
        return dict.fromkeys(subjects, load_world(_path(study.truth, base)).model_dump_json())
    folder = (base / study.recordings).resolve()
    files = {subject: base / study.truth / Path(subject).relative_to(folder) for subject in subjects}
    return {subject: load_world(path.with_suffix(".toml")).model_dump_json() for subject, path in files.items()}


def _identity(path: Path, folder: Path) -> str:
    """Return what makes a recording another one: its path in the folder, its size, a digest of its ends.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            digest = hashlib.sha256(file.read(EDGE_BYTES))
            file.seek(max(0, size - EDGE_BYTES))
            digest.update(file.read(EDGE_BYTES))
    except OSError as error:
        why = error.strerror or error
        raise ConfigError(f"recordings {path}: cannot be read: {why}; check it, or move it elsewhere") from error
    return f"{path.relative_to(folder)} {size} {digest.hexdigest()}"


def _path(name: str, base: Path) -> str:
    """Return a name as it is, and a path in the study as one from the working directory."""
    return str(base / name) if name.endswith(".toml") or "/" in name else name
