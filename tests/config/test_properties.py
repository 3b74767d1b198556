"""Any file and any override give settings, or a ConfigError of printable lines, and no other error."""

from __future__ import annotations

import copy
import datetime
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from config.load import ConfigError, load_any, load_model, load_robot, load_settings, load_world
from tests.config.toml_text import MODEL, ROBOT, RUN, WORLD, document, irregular
from tests.examples import examples

BASES = (RUN, irregular(RUN), ROBOT, WORLD, MODEL, {"robot": "denning", "world": "hallway", "models": ["box"]})


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in entries:
        yield (*at, key)
        yield from places(inner, (*at, key))


WORDS = sorted({k for base in BASES for place in places(base) for k in place if isinstance(k, str)})
keys = st.sampled_from(WORDS) | st.text(max_size=8)
scalars = (
    st.booleans()
    | st.integers(-3, 300)
    | st.integers(-(2**70), 2**70)
    | st.floats()
    | st.text(max_size=10)
    | st.sampled_from(["denning", "box", "octets", "nowhere", "no/such.toml", "cone"])
    | st.dates(min_value=datetime.date(1000, 1, 1))
)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4), max_leaves=12
)
tables = st.dictionaries(keys, values, max_size=6)
paths = st.lists(keys | st.integers(-1, 9).map(str), min_size=1, max_size=5).map(".".join)
overrides = st.lists(
    st.builds(lambda p, v: f"{p}={v}", paths, st.text(max_size=10) | scalars.map(str)) | st.text(max_size=10),
    max_size=3,
)


@st.composite
def mutated(draw: st.DrawFn) -> dict[str, Any]:
    """Return a valid table with a few places changed."""
    table: dict[str, Any] = copy.deepcopy(draw(st.sampled_from(BASES)))
    for _ in range(draw(st.integers(1, 3))):
        every = list(places(table))
        if not every:
            break
        *way, last = draw(st.sampled_from(every))
        holder: Any = table
        for key in way:
            holder = holder[key]
        match draw(st.sampled_from(["replace", "remove", "add"])):
            case "replace":
                holder[last] = draw(values)
            case "remove":
                del holder[last]
            case _ if isinstance(holder, dict):
                holder[draw(keys)] = draw(values)
            case _:
                holder.append(draw(values))
    return table


def check(data: bytes, changes: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.toml"
        path.write_bytes(data)
        for load in (load_settings, load_any, load_robot, load_world, load_model):
            try:
                if load is load_settings:
                    load_settings(path, changes)
                else:
                    load(path)
            except ConfigError as error:
                assert error.problems  # noqa: PT017
                for line in error.problems:
                    assert line.isprintable(), line
                    assert len(line) < 1000, line


@examples(0.1)
@given(tables, overrides)
def test_any_table(table: dict[str, Any], changes: list[str]) -> None:
    check(document(table).encode(), changes)


@examples(0.4)
@given(mutated(), overrides)
def test_a_mutated_valid_table(table: dict[str, Any], changes: list[str]) -> None:
    check(document(table).encode(), changes)


@examples(0.3)
@given(st.binary(max_size=60) | st.text(max_size=60).map(lambda t: t.encode()))
def test_any_bytes(data: bytes) -> None:
    check(data, [])


@examples(0.3)
@given(
    st.lists(st.text(max_size=20) | st.builds("{}={}".format, paths, st.text(max_size=12)), min_size=1, max_size=3)
)
def test_any_override(changes: list[str]) -> None:
    try:
        load_settings(None, changes)
    except ConfigError as error:
        assert all(line.isprintable() for line in error.problems)  # noqa: PT017
