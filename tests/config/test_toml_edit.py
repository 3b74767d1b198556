"""A value of a TOML text is changed where it stands, and nothing else; what is not understood is refused."""

from __future__ import annotations

import tomllib

import pytest
import tomlkit
from hypothesis import given
from hypothesis import strategies as st

from config.toml_edit import Place, TomlEditError, TomlValue, inline, with_value
from tests.examples import examples

ROBOT = """# mine
robot.driver = "skippy"  # of a package
[ring]
count = 6  # as the other count
[skippy]
# counts of the left wheel
trim = 1.1 # measured
[body]
trim = 3
"""
MISSION = """name = "out"
[[step]]
name = "a"
schemas = [{name = "orbit", way_m = 0.5}, { name = "orbit" }]
[[step]]
name = "b"
[[step.schemas]]
name = "orbit"
"""


@pytest.mark.parametrize(
    ("text", "place", "value", "old", "new"),
    [
        (ROBOT, ("skippy", "trim"), 1.25, "trim = 1.1 #", "trim = 1.25 #"),
        (ROBOT, ("skippy", "name"), 'a "b"', "measured\n", 'measured\nname = "a \\"b\\""\n'),
        (ROBOT, ("skippy", "trim"), None, "trim = 1.1 # measured\n", ""),
        (ROBOT, ("other", "on"), True, "trim = 3\n", "trim = 3\n\n[other]\non = true\n"),
        (ROBOT, ("robot", "driver"), "x", '"skippy"', '"x"'),
        (MISSION, ("step", 0, "schemas", 0, "way_m"), 2.0, "way_m = 0.5", "way_m = 2.0"),
        (MISSION, ("step", 0, "schemas", 1, "way_m"), 2.0, '{ name = "orbit" }', '{ name = "orbit", way_m = 2.0}'),
        (
            MISSION,
            ("step", 1, "schemas", 0, "way_m"),
            2.0,
            'schemas]]\nname = "orbit"\n',
            'schemas]]\nname = "orbit"\nway_m = 2.0\n',
        ),
        (MISSION, ("step", 0, "schemas", 0, "way_m"), None, ", way_m = 0.5", " "),
        ('a = """\nx = 1\n"""\n', ("a",), 1, '"""\nx = 1\n"""', "1"),
        ("", ("skippy", "trim"), 1.0, "", "[skippy]\ntrim = 1.0\n"),
    ],
)
def test_only_the_value_changes(text: str, place: Place, value: TomlValue, old: str, new: str) -> None:
    assert with_value(text, place, value) == text.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ("a = [", ("a",), "not TOML"),
        (MISSION, ("step", 7, "name"), "no such table"),
        (MISSION, ("name", "way"), "no such table"),
    ],
)
def test_what_is_not_understood_is_refused(text: str, place: Place, said: str) -> None:
    with pytest.raises(TomlEditError, match=said):
        with_value(text, place, 1)


def test_a_text_that_would_say_something_else_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tomlkit, "dumps", lambda _document: "trim = 2\n")
    with pytest.raises(TomlEditError, match="in the text"):
        with_value(ROBOT, ("skippy", "trim"), 2)


@examples(0.3)
@given(
    st.sampled_from([("skippy", "trim"), ("ring", "count"), ("body", "trim"), ("skippy", "new"), ("robot", "name")]),
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats(-1e9, 1e9) | st.text(max_size=9),
)
def test_the_text_says_what_is_wanted_and_nothing_else(place: tuple[str, str], value: TomlValue) -> None:
    wanted = tomllib.loads(ROBOT)
    wanted[place[0]][place[1]] = value
    changed = with_value(ROBOT, place, value)
    assert tomllib.loads(changed) == wanted
    assert "# measured" in changed
    assert "# of a package" in changed


PLAIN = st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False) | st.text()
NESTED = st.recursive(PLAIN, lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner))


@examples(0.3)
@given(NESTED)
def test_a_value_on_one_line_says_the_same(value: object) -> None:
    text = inline(value)
    assert "\n" not in text
    assert tomllib.loads(f"x = {text}") == {"x": value}
