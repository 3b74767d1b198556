"""What `echolocate tune` searches among: the settings of a study, or those that recordings and scenes show."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.errors import WRONG_CALL, UserError
from config.load import load_study, override_settings
from config.settings import Settings
from config.study import StudyConfig, Value, VaryConfig
from runtime.batch.runs import expand
from runtime.recording.reader import is_recording, open_recording

THRESHOLDS: Final = tuple(
    VaryConfig(setting=f"perception.bayes.{name}", values=(0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.999))
    for name in ("report_probability", "report_probability_near")
)
"""Searched where the truth is known and a study names no settings. Without a truth no threshold can be found: what a
false object costs is for the user to say."""
SENSORS: Final = (
    VaryConfig(setting="ring.beam_half_angle_deg", range=(4.0, 40.0), log=True),
    VaryConfig(setting="ring.resolution_m", range=(0.001, 0.3), log=True),
)
"""What recordings show of the sensors, searched where a study names no settings."""


def study_to_tune(name: str) -> tuple[StudyConfig, Path]:
    """Return the study to tune, and the folder that its relative paths refer to.

    Settings to search among and objectives that the study leaves out are added: `THRESHOLDS` where the truth is
    known, `SENSORS` where there are recordings.

    Parameters
    ----------
    name : str
        A shipped study, a study file, or a folder of recordings.

    Raises
    ------
    UserError
        It is invalid, or cannot be tuned.
    """
    if Path(name).is_dir():
        study, base = StudyConfig(recordings="."), Path(name)
    else:
        study, base = load_study(name), Path(name).parent
    of_recordings = study.recordings is not None
    has_truth = not of_recordings or study.truth is not None
    if "objectives" not in study.model_fields_set:
        study = study.model_copy(update={"objectives": ("f1", "mean_error_m") if has_truth else ("predicted_nat",)})
    if not study.vary:
        judged = "predicted_nat" not in study.objectives
        vary = (*(SENSORS if of_recordings else ()), *(THRESHOLDS if judged else ()))
        study = study.model_copy(update={"vary": vary})
    for one in study.vary:
        if not of_recordings and one.setting.split(".")[0] in ("ring", "body", "robot", "world"):
            raise UserError(
                f"{name}: {one.setting}: scenes and worlds would be sensed by another robot then, not "
                "better by this one: tune it with recordings, or compare robots with a sweep",
                WRONG_CALL,
            )
        if any(part.isdigit() for part in one.setting.split(".")):
            raise UserError(
                f"{name}: {one.setting}: a part of a list cannot be tuned: compare values with a sweep", WRONG_CALL
            )
    return study, base


def present_values(study: StudyConfig, base: Path) -> dict[str, Value]:
    """Return the present value of each varied setting, where it has one; of the first recording if there are any."""
    first = expand(study, base, [{}])[0]
    settings, path = Settings.model_validate_json(first.settings), Path(first.subject)
    if first.kind == "recording" and is_recording(path):
        with open_recording(path) as recording:
            settings = override_settings(recording.settings, str(path), study.sets)
    table, found = settings.model_dump(mode="json"), dict[str, Value]()
    for one in study.vary:
        value: object = table
        for part in one.setting.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        if isinstance(value, bool | int | float | str):
            found[one.setting] = value
    return found
