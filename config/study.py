"""A study file: the runs that `echolocate sweep` makes and compares, or among which `echolocate tune` searches."""

from __future__ import annotations

from typing import Literal, TypeAlias

from pydantic import Field, model_validator

from config.settings import MODELS_MAX
from config.strict import Strict, TomlList

Value: TypeAlias = bool | int | float | str
Objective: TypeAlias = Literal[
    "recall",
    "f1",
    "false",
    "mean_error_m",
    "max_error_m",
    "objects",
    "mean_sigma_m",
    "stops",
    "predicted_nat",
    "virtual_s",
    "cycle_us_p50",
    "cycle_us_p99",
]
"""Figures of a run by which settings can be compared: of recall, f1, objects and predicted_nat more is better, of the
others less. f1 is recall and precision in one: 2 · found / (true + found + false). predicted_nat needs no truth: how
well readings that were withheld from perception are predicted by what it found in the others."""


class VaryConfig(Strict):
    """A setting that is varied: by its values, of which `sweep` makes every combination, or `tune` within a range."""

    setting: str = Field(min_length=1)
    """Its path, as after `--set`; `robot` and `models.0` name files."""
    values: TomlList[Value] = Field(default=(), max_length=1000)
    """Its values, each once."""
    range: TomlList[float] = Field(default=(), max_length=2)
    """Instead of values, for `tune`: the least and the greatest value of a number."""
    log: bool = False
    """Search a range by ratios instead of differences."""

    @model_validator(mode="after")
    def _one_form(self) -> VaryConfig:
        """Refuse a setting with neither values nor a range, with both, or with one that cannot be searched."""
        if bool(self.values) == bool(self.range):
            raise ValueError(f"{self.setting}: give either values or a range, one of the two")
        if self.range and (len(self.range) != 2 or self.range[0] >= self.range[1]):
            raise ValueError(f"range of {self.setting}: give two numbers, the lesser first")
        if self.log and (not self.range or self.range[0] <= 0.0):
            raise ValueError(f"log of {self.setting}: goes with a range above 0")
        if len(set(self.values)) < len(self.values):
            raise ValueError(f"values of {self.setting}: one stands twice: name each once")
        return self


class StudyConfig(Strict):
    """What is run (scenes, worlds or recordings), how often, with which settings, and how the results are compared.

    A path in a study is relative to its folder.
    """

    scenes: TomlList[str] = Field(default=(), max_length=100)
    """Scenes whose readings perception gets at exact poses, as after `experiment hallway --scene`."""
    worlds: TomlList[str] = Field(default=(), max_length=1000)
    """World files through which the robot drives in virtual time, as `experiment hallway --world` does."""
    recordings: str | None = None
    """Folder of recordings (MCAP) and ring logs (CSV) that are replayed."""
    truth: str | None = None
    """The true world of the recordings, or a folder with a world file for each of them, of the same name; a recording
    from the emulator contains its own."""
    seeds: int = Field(default=1, ge=1, le=1_000_000)
    """Runs with each scene or world."""
    first_seed: int = Field(default=0, ge=0, le=1_000_000_000)
    """Seed of the first of them."""
    config: str = "hallway"
    """Run file; recordings (MCAP) keep their own settings."""
    robot: str | None = None
    """Robot file instead of the run file's."""
    models: TomlList[str] = Field(default=(), max_length=MODELS_MAX)
    """Object models instead of the run file's."""
    sets: TomlList[str] = Field(default=(), max_length=100)
    """Settings of all runs, each `path=value` as after `--set`."""
    vary: TomlList[VaryConfig] = Field(default=(), max_length=20)
    """The settings to vary."""
    objectives: TomlList[Objective] = Field(default=("recall", "false", "mean_error_m"), min_length=1, max_length=5)
    """Figures that decide which settings are better; the first counts most."""

    @model_validator(mode="after")
    def _is_complete(self) -> StudyConfig:
        """Refuse a study without one kind of runs, or with settings that do not belong to that kind."""
        given = [bool(self.scenes), bool(self.worlds), self.recordings is not None]
        if sum(given) != 1:
            raise ValueError("a study has one of scenes, worlds and recordings")
        if self.recordings is None and self.truth is not None:
            raise ValueError("truth is that of recordings; scenes and worlds know theirs")
        if self.recordings is None and "predicted_nat" in self.objectives:
            raise ValueError("predicted_nat is for recordings; scenes and worlds know the truth: take f1")
        if self.recordings is not None and (self.seeds > 1 or self.first_seed):
            raise ValueError("a replay has no seed: leave out seeds and first_seed")
        for name, values in (
            ("scenes", self.scenes),
            ("worlds", self.worlds),
            ("objectives", self.objectives),
            ("vary", tuple(vary.setting for vary in self.vary)),
        ):
            if len(set(values)) < len(values):
                raise ValueError(f"{name}: one stands twice: name each once")
        return self
