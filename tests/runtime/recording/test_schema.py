"""Keyframes give back the state they were made of, to the bit; serial data keeps the time of every piece."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import numpy as np
import pytest

from behaviors.avoid_static_obstacle import avoid_static_obstacle
from behaviors.move_ahead import Leg
from behaviors.response import Response, summed
from config.behaviors import AvoidStaticObstacleConfig
from config.load import load_settings
from drivers.messages import Pose
from perception.percept import Percept
from perception.pipeline import Perception
from runtime.cycle.step import CycleRecord, State
from runtime.recording.channels import decode, encode
from runtime.recording.schema import (
    CarriedState,
    Keyframe,
    SerialBytes,
    carried_state,
    keyframe,
    perception_snapshot,
    state_fields,
)
from tests.behaviors.views import EVERYWHERE

RECORD = np.dtype([("x", "<f8", (2,)), ("flag", "?"), ("inner", [("count", "<i4")])])


def a_state() -> State:
    settings = load_settings("hallway", ["perception.method=paper"])
    return State(Perception(settings.ring, settings.models, settings.perception))


def test_arrays_of_every_layout_come_back_to_the_bit() -> None:
    records = np.zeros((2, 3), RECORD)
    records["x"][1, 2] = math.nan, -0.0
    records["inner"]["count"] = np.arange(6).reshape(2, 3)
    arrays = {
        "scalar": np.array(1.5),
        "empty": np.empty((0, 5)),
        "flags": np.array([True, False]),
        "records": records,
        "numbers": np.array([[1, -(2**62)]]),
    }
    frame = decode(Keyframe, encode(keyframe(3, 0.15, carried_state(a_state()), arrays)))
    assert (frame.cycle, frame.run_s) == (3, 0.15)
    found = perception_snapshot(frame, arrays)
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
        assert found[name].tobytes() == array.tobytes()


def test_the_carried_state_comes_back() -> None:
    state = a_state()
    state.cycle, state.run_s, state.leg = 7, 0.35, Leg(-0.0, 3.0)
    fields = carried_state(state)
    assert "perception" not in fields
    frame = decode(Keyframe, encode(keyframe(7, 0.35, fields, {})))
    found = state_fields(frame)
    assert found == fields
    assert repr(found) == repr(fields)


def test_a_push_without_bound_comes_back() -> None:
    """Arkin's repulsion inside the safety margin, with the largest gain, from a whole ring on one side."""
    config = AvoidStaticObstacleConfig(avoid_obstacle_gain=100.0, summing="sum")
    angles = np.linspace(-0.5, 0.5, 256)
    near = np.column_stack([0.3 * np.cos(angles), 0.3 * np.sin(angles)])
    push = avoid_static_obstacle(Percept(Pose(0.0, 0.0, 0.0), near, EVERYWHERE), 0.3, config)
    assert math.hypot(push.x, push.y) > 1e10
    state = a_state()
    state.vectors = (push, Response("sum", *summed((push, push))))
    fields = carried_state(state)
    assert state_fields(decode(Keyframe, encode(keyframe(1, 0.05, fields, {})))) == fields


def test_pieces_of_serial_data_keep_their_times() -> None:
    payload = SerialBytes(run_s=2.0, after_us=[0, 1500, 1500], sizes=[2, 0, 1], data="00ff0a")
    times_s, data = zip(*decode(SerialBytes, encode(payload)).pieces(), strict=True)
    assert times_s == pytest.approx((2.0, 2.0015, 2.0015))
    assert data == (b"\x00\xff", b"", b"\n")
    with pytest.raises(ValueError, match="2 pieces of data with 1 times"):
        SerialBytes(run_s=0.0, after_us=[0], sizes=[1, 1], data="0000").pieces()


VALIDATED = ("drive_request", "edits")
"""Fields of which a cycle itself refuses what it cannot carry out."""


def unbounded(hint: Any, path: str) -> Iterator[str]:
    """Yield each number within a type whose annotation bounds nothing."""
    if get_origin(hint) is Annotated:
        kind, *details = get_args(hint)
        if kind in {int, float} or not any(hasattr(detail, "metadata") for detail in details):
            hint = None if kind in {int, float} or "ndarray" in str(kind) else kind
        else:
            hint = None
    if hint in {int, float}:
        yield path
    elif dataclasses.is_dataclass(hint):
        for name, inner in get_type_hints(hint, include_extras=True).items():
            if name not in VALIDATED:
                yield from unbounded(inner, f"{path}.{name}")
    else:
        for inner in get_args(hint):
            yield from unbounded(inner, path)


def test_every_recorded_number_has_a_bound_beside_it() -> None:
    carried = {name: field for name, field in CarriedState.model_fields.items() if name not in VALIDATED}
    hints = {name: Annotated[field.annotation, *field.metadata] if field.metadata else field.annotation
             for name, field in carried.items()}  # fmt: skip
    found = [path for name, hint in hints.items() for path in unbounded(hint, name)]
    assert [*found, *unbounded(CycleRecord, "record")] == []
