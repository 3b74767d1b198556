"""Single settings from the command line by `--set`: they override the files, and errors are explained."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from config.load import load_settings
from tests.config.loading import problem, problems, write
from tests.config.toml_text import ROBOT, irregular

pytestmark = pytest.mark.usefixtures("elsewhere")


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("ring.firing=quadrants", "ring.firing.preset", "quadrants"),
        ('ring.firing = "quadrants"', "ring.firing.preset", "quadrants"),
        ("ring.firing={preset='thirds', step_period_s=0.1}", "ring.firing.step_period_s", 0.1),
        ("ring.firing.step_period_s=0.1", "ring.firing.preset", "octets"),
        ("ring.firing={sets=[[0, 12], [6]]}", "ring.firing.sets", ((0, 12), (6,))),
        ("perception.clusters.threshold_m=0.5", "perception.clusters.threshold_m", 0.5),
        ("cycle.rate_hz=50", "cycle.rate_hz", 50.0),
        ("body.synchro=false", "body.synchro", False),
        ("log.level=debug", "log.level", "debug"),
        ("link.port=/dev/ttyUSB0", "link.port", "/dev/ttyUSB0"),
        ("link.port=COM3=x", "link.port", "COM3=x"),
        ("log.file='5'", "log.file", "5"),
        ("world.drum.0.x_m=1.5", "world.drum.0.x_m", 1.5),
        ("world.drum.5.radius_m=1", "world.drum.5.radius_m", 1.0),
        ("world.acoustics={dropout=0.5}", "world.acoustics.dropout", 0.5),
        ("world={}", "world.drum", ()),
        ("models.0=box", "models.0.name", "box"),
        ("models=[drum]", None, None),
        ("models=['drum', 'box']", "models.1.name", "box"),
        ("models.0.vertices_m.1.0=0.2", "models.0.vertices_m.1.0", 0.2),
    ],
)
def test_set(text: str, path: str | None, value: object) -> None:
    if path is None:
        assert problem(None, [text]).startswith(f"--set {text}: the value begins like a TOML list")
        return
    found: Any = load_settings(None, [text])
    for key in path.split("."):
        found = found[int(key)] if key.isdigit() else getattr(found, key)
    assert found == value
    assert type(found) is type(value)


def test_set_overrides_the_files_and_a_later_one_the_earlier(tmp_path: Path) -> None:
    run = write(tmp_path / "run.toml", {"robot": "denning", "body": {"radius_m": 0.2}})
    assert load_settings(run, ["body.radius_m=0.3"]).body.radius_m == 0.3
    assert load_settings(run, ["body.radius_m=0.3", "body.radius_m=0.5"]).body.radius_m == 0.5
    assert load_settings(run, ["world.drum.7.x_m=9", "world=irregular"]).world.drum[7].x_m == 9.0  # type: ignore[union-attr]


@pytest.mark.parametrize("text", ["foo", "", "=", "=1", ".a=1", "a.=1", "a..b=1", " =1"])
def test_set_of_another_form(text: str) -> None:
    assert problem(None, [text]).startswith(f"--set {text}: must have the form section.key=value")


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("world.drum.6.x_m=1", "--set: world.drum.6.x_m: world.drum has 6 entries, numbered from 0"),
        ("world.drum.-1.x_m=1", "--set: world.drum.-1.x_m: world.drum is a list: its entries have numbers from 0"),
        ("world.drum.x_m=1", "--set: world.drum.x_m: world.drum is a list: its entries have numbers from 0, not the"),
        ("world.drum.²=1", "--set: world.drum.²: world.drum is a list"),
        ("world.drum.99999999999=1", "--set: world.drum.99999999999: world.drum is a list"),
        ("ring.count.x=1", "--set: ring.count.x: ring.count is a single value"),
        ("models.1=box", "--set: models.1: models has 1 entry"),
        ("a.b.c.d.e.f.g.h.i.j.k.l.m.n=1", "--set a.b.c.d.e.f.g.h.i.j.k.l.m.n=1: no setting lies that deep"),
        ("cycle.rate_hz=0x" + "f" * 300, "--set cycle.rate_hz=0xfff"),
        ("cycle.rate_hz=" + "9" * 6000, "--set cycle.rate_hz=999"),
        ("cycle.rate_hz=" + "[" * 4000, "--set cycle.rate_hz=[[["),
        ("cycle.rate_hz=1\nring = 5", "--set: cycle.rate_hz = "),
        ("cycle.rate_hz=", '--set: cycle.rate_hz = "": must be a number, not a string'),
        ("cycle.rate_hz=nan", "--set: cycle.rate_hz = nan: must be a finite number"),
        ("cycle.rate_hz=fast", '--set: cycle.rate_hz = "fast": must be a number, not a string'),
        ("cycle.rate_hz=1979-05-27", "--set: cycle.rate_hz = 1979-05-27: must be a number, not a date or time"),
        ("cycle.rate=1", "--set: cycle.rate: unknown key; did you mean rate_hz?"),
        ("percepton.clusters.threshold_m=1", "--set: percepton: unknown key; did you mean perception?"),
        ("clusters.threshold_m=1", "--set: clusters: unknown key; did you mean perception.clusters?"),
        ("log.level=verbos", '--set: log.level = "verbos": must be one of debug, info, warning, error'),
        ("ring.firing=octet", '--set: ring.firing.preset = "octet": must be one of single, opposite_pairs, thirds, '),
        ("ring.firing=7", "--set: ring.firing = 7: must be a table, not an integer"),
        ("ring.firing.sets=[[0]]", "--set over robots/denning.toml: ring.firing: give either preset or sets"),
        ("world.drum.0.radius=2", "--set: world.drum.0.radius: unknown key; did you mean radius_m?"),
        ("models.0.closed=1", "--set: models.0.closed = 1: must be true or false, not an integer"),
        ("ring.beam_half_angle_deg=120", "--set: ring.beam_half_angle_deg = 120: must be below 90 (and above 0)"),
    ],
)
def test_an_invalid_set(text: str, wanted: str) -> None:
    line = problem(None, [text])
    assert line.startswith(wanted)
    assert len(line) < 250


def test_every_bad_set_is_reported() -> None:
    assert len(problems(None, ["foo", "bar", "ring.count.x=1", "world=nowhere"])) == 4


def test_a_preset_over_sets_is_refused(tmp_path: Path) -> None:
    mine = write(tmp_path / "mine.toml", irregular(ROBOT))
    line = problem(mine, ["ring.firing.preset=single"])
    assert line == f"--set over {mine}: ring.firing: give either preset or sets, one of the two"
