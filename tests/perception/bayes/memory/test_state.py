"""The memory: one block of records that is cleared in place and keeps its counters of numbers."""

from __future__ import annotations

import numpy as np

from perception.bayes.memory.parameters import START_NOISE, START_NOISE_NAT
from perception.bayes.memory.state import Memory


def test_a_new_memory_is_empty_and_assumes_the_starting_noise() -> None:
    memory = Memory(24, 5)
    state = memory.state
    assert (len(memory.circles), len(memory.tracks)) == (5, 5)
    assert (state["sensor_count"][0], state["noise_level"][0]) == (24, START_NOISE)
    assert state["roughness_nat"][0].argmax() == START_NOISE
    assert state["roughness_nat"][0].sum() == START_NOISE_NAT
    assert np.isnan(state["sensors"]["last"]["x"]).all(), "any first reading of a sensor is new"
    assert not memory.circles.view(np.uint8).any()
    assert not memory.polygons.view(np.uint8).any()


def test_a_cleared_memory_equals_a_new_one_except_the_numbers_that_were_given() -> None:
    memory, new = Memory(24, 5), Memory(24, 5)
    memory.state["scratch"].view(np.uint8)[...] = 7
    memory.circles.view(np.uint8)[...] = 7
    memory.state["buckets"]["count"] = 3
    memory.state["objects_numbered"], memory.state["segments_numbered"] = 11, 12
    array = memory.state
    memory.clear()
    assert memory.state is array, "kernels keep the same block"
    assert (memory.state["objects_numbered"][0], memory.state["segments_numbered"][0]) == (11, 12)
    memory.state["objects_numbered"] = memory.state["segments_numbered"] = 0
    assert memory.state.tobytes() == new.state.tobytes()
    assert memory.circles.tobytes() == new.circles.tobytes()


def test_kernels_and_numpy_see_the_same_memory() -> None:
    memory = Memory(24, 5)
    memory.s[0].polygons[3].x = 1.5
    memory.tracks[2].number = 8
    memory.s[0].ring_x = 2.5
    assert (memory.polygons["x"][3], memory.circles["number"][2], memory.state["ring_x"][0]) == (1.5, 8, 2.5)


def test_walls_are_cleared_alone() -> None:
    memory, new = Memory(24, 5), Memory(24, 5)
    memory.state["room"]["walls"]["weight"] = 3.0
    memory.state["room"]["remembered_count"] = memory.state["segments_held"] = 9
    memory.clear_walls()
    assert memory.state["segments_held"][0] == 9
    memory.state["segments_held"] = 0
    assert memory.state.tobytes() == new.state.tobytes()
