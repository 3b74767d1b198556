"""Study files: the shipped one and the documented ones load, and what makes no sense is refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from config.files import ConfigError, list_shipped
from config.load import load_any, load_study, parse_text
from config.study import StudyConfig

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "sweeps.md"
VARY = '[[vary]]\nsetting = "a"\nvalues = [1, 2]\n'


def study(text: str) -> StudyConfig:
    return parse_text(StudyConfig, text, "study")


def test_every_shipped_study_loads() -> None:
    for name in list_shipped("studies"):
        assert load_study(name).vary


def test_check_knows_a_study(tmp_path: Path) -> None:
    path = tmp_path / "my.toml"
    path.write_text('scenes = ["clean"]\nseeds = 3\n' + VARY)
    assert load_any(path) == load_study(path)


def test_the_documented_studies_load() -> None:
    texts = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL)
    assert len(texts) >= 2
    for text in texts:
        study(text)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("seeds = 2", "one of scenes, worlds and recordings"),
        ('scenes = ["clean"]\nworlds = ["hallway"]', "one of scenes, worlds and recordings"),
        ('scenes = ["clean"]\ntruth = "hallway"', "truth is that of recordings"),
        ('recordings = "runs"\nseeds = 2', "a replay has no seed"),
        ('scenes = ["clean", "clean"]', "scenes: one stands twice"),
        ('scenes = ["clean"]\n' + VARY + VARY, "vary: one stands twice"),
        ('scenes = ["clean"]\n[[vary]]\nsetting = "a"\nvalues = [1, 1.0]', "values of a: one stands twice"),
        ('scenes = ["clean"]\nobjectives = ["speed"]', "objectives"),
        ('scenes = ["clean"]\nobjectives = ["predicted_nat"]', "predicted_nat is for recordings"),
        ('scenes = ["clean"]\n[[vary]]\nsetting = "a"', "either values or a range"),
        ('scenes = ["clean"]\n' + VARY + "range = [1.0, 2.0]", "either values or a range"),
        ('scenes = ["clean"]\n[[vary]]\nsetting = "a"\nrange = [2.0, 1.0]', "two numbers, the lesser first"),
        ('scenes = ["clean"]\n[[vary]]\nsetting = "a"\nrange = [0.0, 1.0]\nlog = true', "a range above 0"),
    ],
)
def test_a_study_that_makes_no_sense_is_refused(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=problem):
        study(text)
