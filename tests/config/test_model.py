"""Outlines that no object can have are refused, with the file and the vertex."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.load import ConfigError, list_shipped, load_model
from config.model import NAME_MAX, ModelConfig
from tests.examples import examples

SQUARE = [(0.3, 0.3), (-0.3, 0.3), (-0.3, -0.3), (0.3, -0.3)]


def write(folder: Path, vertices: list[tuple[float, float]], *, closed: bool = True, more: str = "") -> str:
    path = folder / "post.toml"
    listed = ", ".join(f"[{x}, {y}]" for x, y in vertices)
    path.write_text(f'name = "post"\nvertices_m = [{listed}]\nclosed = {str(closed).lower()}\n{more}\n')
    return str(path)


WRONG = [
    ([(0.3, 0.3), (-0.3, -0.3), (-0.3, 0.3), (0.3, -0.3)], True, "", ("side from vertex", "crosses", "vertex 0")),
    ([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.5, -0.5)], False, "", ("the side from vertex 2 crosses", "vertex 0")),
    ([(0.0, 0.0), (1.0, 0.0), (0.4, 0.0)], False, "", ("the side from vertex 1 crosses the side from vertex 0",)),
    ([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.0)], False, "", ("the side from vertex 2 crosses",)),
    ([*SQUARE, SQUARE[0]], True, "", ("vertex 4", "repeats vertex 0", "closed = true closes")),
    ([SQUARE[0], SQUARE[1], SQUARE[1], SQUARE[2]], True, "", ("vertex 2 [-0.3, 0.3] repeats vertex 1",)),
    ([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)], False, "", ("vertex 3", "repeats vertex 0")),
    ([(0.3, 0.3)], False, "", ("vertices_m", "at least 2")),
    ([(0.3, 0.3), (0.0, 0.0)], True, "", ("at least three vertices",)),
    ([(300.0, 300.0), (-300.0, 300.0), (-300.0, -300.0)], True, "", ("vertex 0", "millimetres", "give metres")),
    ([(0.0003, 0.0003), (-0.0003, 0.0003), (-0.0003, -0.0003)], True, "", ("vertex 0", "too small", "give metres")),
]


@pytest.mark.parametrize(("vertices", "closed", "more", "words"), WRONG)
def test_it_is_refused_with_file_and_vertex(
    tmp_path: Path, vertices: list[tuple[float, float]], closed: bool, more: str, words: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError) as caught:
        load_model(write(tmp_path, vertices, closed=closed, more=more))
    text = str(caught.value)
    assert "post.toml" in text
    assert "\n" not in text
    assert all(word in text for word in words), text


def test_a_name_longer_than_a_list_shows_is_refused(tmp_path: Path) -> None:
    path = Path(write(tmp_path, SQUARE))
    path.write_text(path.read_text().replace("post", "p" * (NAME_MAX + 1)))
    with pytest.raises(ConfigError, match=rf"post\.toml.*name.*{NAME_MAX}"):
        load_model(str(path))


def test_shipped_models_and_plain_shapes_are_accepted(tmp_path: Path) -> None:
    for name in list_shipped("models"):
        assert load_model(name).vertices_m
    assert load_model(write(tmp_path, SQUARE)).closed
    assert len(load_model(write(tmp_path, [(0.0, 0.0), (1.0, 0.0)], closed=False)).vertices_m) == 2
    load_model(write(tmp_path, [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], closed=False))  # straight on


@examples(0.5)
@given(
    st.integers(3, 20),
    st.floats(0.05, 5.0),
    st.floats(0.0, 6.3),
    st.booleans(),
    st.lists(st.floats(0.5, 1.0), min_size=20),
)
def test_no_star_shaped_outline_is_refused(
    n: int, size: float, turn: float, closed: bool, share: list[float]
) -> None:
    angles = [turn + 2.0 * math.pi * k / n for k in range(n)]
    vertices = tuple((size * s * math.cos(a), size * s * math.sin(a)) for a, s in zip(angles, share, strict=False))
    ModelConfig(name="star", vertices_m=vertices, closed=closed)


@examples(0.3)
@given(st.integers(4, 12), st.data())
def test_a_swap_of_two_corners_of_a_convex_outline_is_found(n: int, data: st.DataObject) -> None:
    """From four corners on, every swap of neighbours makes two sides cross."""
    vertices = [(math.cos(2.0 * math.pi * k / n), math.sin(2.0 * math.pi * k / n)) for k in range(n)]
    i = data.draw(st.integers(0, n - 1))
    j = (i + 1) % n
    vertices[i], vertices[j] = vertices[j], vertices[i]
    with pytest.raises(ValueError, match="crosses"):
        ModelConfig(name="knot", vertices_m=tuple(vertices), closed=True)
