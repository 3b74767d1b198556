"""What a search found, in words: changes that a run file can contain, an honest judgement, a page without markup."""

from __future__ import annotations

import csv
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from config.load import load_settings
from config.study import StudyConfig, VaryConfig
from runtime.analysis.report.html_parts import tile
from runtime.batch.outcome import Combination
from runtime.batch.tuning import Difference, Trial, Tuned
from runtime.batch.tuning_report import change_lines, changes_text, gain_lines, judgement, trials_text, tuning_page

BEAM, SURE = "ring.beam_half_angle_deg", "perception.bayes.report_probability"
STUDY = StudyConfig(
    scenes=("a<b",),
    vary=(VaryConfig(setting=BEAM, range=(4.0, 40.0)), VaryConfig(setting=SURE, values=(0.5, 0.9))),
    objectives=("f1",),
)
PRESENT = Trial({}, -0.25, Combination({}, 4, 0, {"f1": 0.25}))
BEST = Trial({BEAM: 10.5, SURE: 0.9}, -1.0, Combination({BEAM: 10.5, SURE: 0.9}, 4, 0, {"f1": 1.0}))
LOST = Trial({BEAM: 5.0, SURE: 0.5}, math.inf, None)
GAIN = Difference("f1", 0.25, 1.0, 4, 0.75, 0.05)
TUNED = Tuned(PRESENT, BEST, [BEST, LOST], [GAIN], [GAIN])


def test_the_changes_belong_into_a_run_file(tmp_path: Path) -> None:
    text = changes_text("my", STUDY, TUNED)
    assert tomllib.loads(text) == {"ring": {"beam_half_angle_deg": 10.5}, "perception": {
        "bayes": {"report_probability": 0.9}}}  # fmt: skip
    assert "# f1: 0.25 → 1, +0.75 ± 0.05 (95 %, 4 runs)\n" in text
    run = tmp_path / "run.toml"
    run.write_text('robot = "denning"\n' + text)
    settings = load_settings(run)
    assert (settings.ring.beam_half_angle_deg, settings.perception.bayes.report_probability) == (10.5, 0.9)
    assert change_lines(TUNED, {BEAM: 24.0}) == [f"{BEAM}: 24.0 → 10.5", f"{SURE}: not set → 0.9"]


@pytest.mark.parametrize(
    ("tuned", "words"),
    [
        (TUNED, "the changes are better in what was held out (4 runs)"),
        (replace(TUNED, best=PRESENT, held_out=[]), "keep them"),
        (replace(TUNED, held_out=[]), "nothing was held out"),
        (replace(TUNED, held_out=[GAIN._replace(half_width=math.inf)]), "too few runs were held out"),
        (replace(TUNED, held_out=[GAIN._replace(half_width=0.8)]), "no difference beyond chance"),
        (replace(TUNED, held_out=[GAIN._replace(mean=-0.2)]), "are worse"),
        (replace(TUNED, held_out=[GAIN._replace(objective="false", mean=-2.0)]), "are better"),
    ],
)
def test_the_judgement_is_that_of_what_was_held_out(tuned: Tuned, words: str) -> None:
    assert words in judgement(tuned)


def test_without_runs_to_compare_the_gain_is_said_to_be_that_of_the_search() -> None:
    alone = replace(TUNED, held_out=[], searched=[GAIN._replace(runs=1, half_width=math.inf)])
    assert gain_lines(alone) == ["f1: 0.25 → 1, +0.75 (too few runs to say how sure: 1)"]


def test_every_trial_is_in_the_table() -> None:
    rows = list(csv.DictReader(trials_text(STUDY, TUNED).splitlines()))
    assert [(row["trial"], row[BEAM], row["f1"], row["cost"]) for row in rows] == [
        ("0", "", "0.25", "-0.25"), ("1", "10.5", "1.0", "-1.0"), ("2", "5.0", "", ""),
    ]  # fmt: skip


def test_the_page_shows_changes_gain_and_course() -> None:
    text = tuning_page("my <study>", STUDY, {BEAM: 24.0}, replace(TUNED, dropped={"a.b": 1}), [])
    for shown in ("my &lt;study&gt;", "a&lt;b", BEAM, "24.0", "+0.75 ± 0.05", "Held out", "brought nothing: a.b"):
        assert shown in text
    assert text.count("<figure>") == 1
    only_recall = replace(TUNED, held_out=[Difference("recall", 0.5, 0.75, 4, 0.25, 0.05)])
    assert tile("0.5 → 0.75", "recall") in tuning_page("x", STUDY, {}, only_recall, []), "f1 is not known there"
    assert "The changes are better in what was held out" in text
    assert "No change is better" in tuning_page(
        "x", STUDY, {}, replace(TUNED, best=PRESENT, held_out=[], searched=[]), []
    )
