"""The messages of any robot: poses, angles, and arrays that pydantic records exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from drivers.messages import CrossPaths, Firing, Flags, Floats, Pose, Ranges, RecordedFlags, wrap_angle

ANGLE = st.floats(-20.0, 20.0)
PLACE = st.floats(-10.0, 10.0)
POSES = st.builds(Pose, PLACE, PLACE, ANGLE)


@given(ANGLE)
def test_a_wrapped_angle_has_the_same_direction(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-12)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-12)


@given(POSES, POSES)
def test_composition_is_the_product_of_matrices(a: Pose, b: Pose) -> None:
    def matrix(pose: Pose) -> np.ndarray:
        c, s = math.cos(pose.theta), math.sin(pose.theta)
        return np.array([[c, -s, pose.x], [s, c, pose.y], [0.0, 0.0, 1.0]])

    np.testing.assert_allclose(matrix(a.compose(b)), matrix(a) @ matrix(b), atol=1e-12)
    np.testing.assert_allclose(matrix(a.inverse()), np.linalg.inv(matrix(a)), atol=1e-9)


def test_an_array_is_written_as_a_list_and_read_back_to_the_bit() -> None:
    adapter: TypeAdapter[np.ndarray] = TypeAdapter(Floats)
    array = np.array([0.1, 1.0 / 3.0, -0.0, 1e-308, np.nextafter(1.0, 2.0)])
    back = adapter.validate_json(adapter.dump_json(array))
    assert back.dtype == np.float64
    assert back.tobytes() == array.tobytes()
    with pytest.raises(ValueError, match="valid number"):
        adapter.validate_python(["one"])


def test_ranges_and_flags_are_bounded() -> None:
    ranges: TypeAdapter[np.ndarray] = TypeAdapter(Ranges)
    assert ranges.validate_python([0.0, math.inf, math.nan, 1e3]).shape == (4,)
    for value in (-1.0, 1.1e3, -math.inf):
        with pytest.raises(ValueError, match="a range of"):
            ranges.validate_python([1.0, value])
    flags: TypeAdapter[Flags] = TypeAdapter(RecordedFlags)
    assert flags.validate_python(3) == Flags.LATCHED | Flags.BUMPER
    with pytest.raises(ValueError, match="less than or equal"):
        flags.validate_python(2**60)


@pytest.mark.parametrize(
    ("heard", "message"),
    [
        (([0], [1, 2], [1.0]), "arrays of"),
        (([], [], []), "arrays of"),
        (([0] * 4, [1] * 4, [1.0] * 4), "arrays of"),
        (([0], [3], [1.0]), "name sensor 3 of 3"),
        (([1], [1], [1.0]), "hears itself"),
        (([0], [1], [math.nan]), "no number"),
    ],
)
def test_cross_paths_belong_to_the_ring(heard: tuple[list[int], list[int], list[float]], message: str) -> None:
    def firing(transmitters: list[int], listeners: list[int], half_paths_m: list[float]) -> Firing:
        paths = CrossPaths(np.array(transmitters, np.int64), np.array(listeners, np.int64), np.array(half_paths_m))
        return Firing(0.0, Pose(0.0, 0.0, 0.0), 0.0, np.ones(3), paths)

    assert firing([0], [2], [math.inf]).contradiction() is None
    assert message in (firing(*heard).contradiction() or "")
