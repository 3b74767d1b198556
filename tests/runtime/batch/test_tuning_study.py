"""What a search varies where its study names no settings, and the present values."""

from __future__ import annotations

from pathlib import Path

from runtime.batch.tuning_study import SENSORS, THRESHOLDS, present_values, study_to_tune


def test_a_folder_of_recordings_is_a_study(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t,x,y,theta,r00\n0,0,0,0,1\n")
    study, base = study_to_tune(str(tmp_path))
    assert (study.objectives, study.vary, base) == (("predicted_nat",), SENSORS, tmp_path)
    assert present_values(study, base) == {"ring.beam_half_angle_deg": 12.0, "ring.resolution_m": 0.03048}
    (tmp_path / "s.toml").write_text('recordings = "."\ntruth = "hallway"\nsets = ["ring.resolution_m=0.01"]\n')
    study, base = study_to_tune(str(tmp_path / "s.toml"))
    assert (study.objectives, study.vary) == (("f1", "mean_error_m"), (*SENSORS, *THRESHOLDS))
    assert present_values(study, base)["ring.resolution_m"] == 0.01
    (tmp_path / "s.toml").write_text('scenes = ["halls"]\n')
    assert study_to_tune(str(tmp_path / "s.toml"))[0].vary == THRESHOLDS


def test_the_present_values_of_a_recording_are_its_own(hall_run: Path, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").symlink_to(hall_run)
    (tmp_path / "s.toml").write_text('recordings = "."\nsets = ["ring.beam_half_angle_deg=7.0"]\n')
    assert present_values(*study_to_tune(str(tmp_path / "s.toml")))["ring.beam_half_angle_deg"] == 7.0
