"""Problems of settings files beside their lines: every key of every shipped file, broken."""

from __future__ import annotations

import random
import re
from importlib.resources import files
from pathlib import Path

import pytest

from config.files import ConfigError, Kind, list_shipped
from config.load import load_any
from config.toml_lines import Problem, located

KINDS: tuple[Kind, ...] = ("robots", "worlds", "models", "missions")
KEY = re.compile(r"[a-z_]+(?= = )")
LISTS = (
    """# a list of tables, and one in it
[robot]
name = "x"
[ring]
sensors = [
  {x = 1},
]
[[a.b]]
c = 1
[[a.b]]
c = """
    + '"""'
    + """
c = 5"""
    + '"""'
    + """
d.e = 3
[a.b."f g"]
h = 1
"""
)


@pytest.mark.parametrize("kind", KINDS)
def test_a_misspelt_key_of_any_shipped_file_is_found_in_its_line(kind: Kind, tmp_path: Path) -> None:
    rng = random.Random(kind)
    for name in list_shipped(kind):
        lines = (files("config") / kind / f"{name}.toml").read_text("utf-8").splitlines()
        keyed = [n for n, line in enumerate(lines) if KEY.match(line)]
        for n in rng.sample(keyed, min(2, len(keyed))):
            changed = [*lines[:n], KEY.sub("misspelt", lines[n], count=1), *lines[n + 1 :]]
            path = tmp_path / f"{name}.toml"
            path.write_text(text := "\n".join(changed))
            with pytest.raises(ConfigError) as caught:
                load_any(path)
            assert n + 1 in [located(problem, str(path), text).line for problem in caught.value.problems], text


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        (1, 'robot "nope"'), (3, "missing.toml"), (5, "m.toml"), (7, 'mission "dok"'),
    ],
)  # fmt: skip
@pytest.mark.parametrize("folder", ["", "there"])
def test_a_name_of_nothing_is_found_in_the_line_that_names_it(
    folder: str, line: int, problem: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    path = Path(folder) / "run.toml"
    path.parent.mkdir(exist_ok=True)
    path.write_text(
        text
        := 'robot = \'nope\'\n# "./missing.toml"\nworld = "./missing.toml"\nmodels = [\n  "drum", "./m.toml",\n]\n'
        'mission = "dok"\n'
    )
    with pytest.raises(ConfigError) as caught:
        load_any(path)
    (said,) = (one for one in caught.value.problems if problem in one)
    assert located(said, str(path), text).line == line


@pytest.mark.parametrize(
    ("problem", "line"),
    [
        ("f: robot.foo: unknown key", 2), ('f: robot.name = "x": too short', 3), ("f: ring.sensors.0.x = 1: bad", 5),
        ("f: a.b.0: missing", 8), ("f: a.b.1.c = 2: bad", 11), ("f: a.b.1.d.e = 3: bad", 13),
        ('f: a.b.1."f g".h = 1: bad', 15), ("f: body: missing", None), ("g: robot.name = 1: bad", None),
        ("f: line 4, column 2: Expected", 4), ("f: larger than 256 KiB", None),
    ],
)  # fmt: skip
def test_a_problem_is_placed(problem: str, line: int | None) -> None:
    assert located(problem, "f", LISTS).line == line


def test_the_place_is_not_said_twice() -> None:
    assert located("f: line 4, column 2: Expected x", "f", "") == Problem(4, "Expected x")
