"""Work on polygons in quanta: each is bounded, and the result does not depend on where the work was cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from config.load import load_settings
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import POLYGON_BEARING_BINS, POLYGON_BIN_CAPACITY
from perception.bayes.memory.job_records import INITIATION, NO_JOB, REFINEMENT
from perception.bayes.memory.polygon_parameters import COLLECTING_COST, QUANTUM_COST
from perception.bayes.memory.state import FREE, Memory
from perception.bayes.polygons.initiation import advance_initiation, next_request
from perception.bayes.polygons.job import cost, keep_best
from perception.bayes.tracks.polygon_tracks import advance_refinement, begin_refinement, polygon_quantum
from perception.pipeline import Perception
from runtime.simulation.open_loop import perceive
from runtime.simulation.scenes import halls, readings

pytestmark = [pytest.mark.compiled, pytest.mark.soak]  # to compile its kernels for Python takes 18 s

FT = 0.3048
SETTINGS = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
THRESHOLD = SETTINGS.perception.bayes.fresh_share
RESERVOIR = POLYGON_BEARING_BINS * POLYGON_BIN_CAPACITY
POSE_MAX = cost(RESERVOIR, 1, 4)
"""What scoring one pose costs at most."""
STEP_MAX = 2 * POSE_MAX + (P[0].circle_count + 1) * POSE_MAX + COLLECTING_COST
"""No step that cannot be cut costs more."""


def copy(memory: Memory) -> Memory:
    other = Memory(len(SETTINGS.ring.mounts), len(memory.circles))
    other.state[...], other.circles[...] = memory.state, memory.circles
    return other


def quantum(memory: Memory) -> bool:
    return polygon_quantum(memory.s, memory.tracks, P, THRESHOLD)


def memories() -> Iterator[Memory]:
    """Yield memories from several moments of a drive past boxes, each between two jobs."""
    hall = next(h for h in halls("boxes", 0) if h.world.acoustics.model == "specular")
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    assert isinstance(perception.method, BayesPerception)
    for k, firing in enumerate(readings(SETTINGS.ring, hall, 0)):
        perceive(perception, firing)
        if k > 20 and k % 4 == 0:
            memory = copy(perception.method.memory)
            while memory.s[0].job.kind != NO_JOB:
                quantum(memory)
            yield memory


def finish(memory: Memory, left: int) -> list[int]:
    """Finish the job in steps that may each cost `left`; return what each did cost."""
    spent = []
    while memory.s[0].job.kind != NO_JOB:
        if memory.s[0].job.kind == REFINEMENT:
            spent.append(advance_refinement(memory.s, memory.tracks, P, left))
        else:
            spent.append(advance_initiation(memory.s, P, left))
        assert len(spent) < 100_000
    return spent


BEGIN: tuple[Callable[[Memory], bool], ...] = (
    lambda memory: begin_refinement(memory.s, P, THRESHOLD), lambda memory: next_request(memory.s),
)  # fmt: skip


def test_a_step_costs_what_is_left_or_the_least_there_is() -> None:
    kinds = {INITIATION: 0, REFINEMENT: 0}
    for memory in memories():
        for begin in BEGIN:
            if begin(memory):
                kinds[int(memory.s[0].job.kind)] += 1
                spent = finish(memory, QUANTUM_COST)
                assert min(spent) > 0
                assert max(spent) <= QUANTUM_COST + STEP_MAX
    assert min(kinds.values()) >= 3
    assert STEP_MAX < QUANTUM_COST


def test_the_result_of_a_job_does_not_depend_on_where_it_was_cut() -> None:
    jobs = 0
    for memory in memories():
        for begin in BEGIN:
            whole, cut = copy(memory), copy(memory)
            if begin(whole):
                jobs += 1
                assert begin(cut)
                assert len(finish(whole, 10**9)) < len(finish(cut, 1))
                assert whole.polygons.tobytes() == cut.polygons.tobytes()
                assert whole.circles.tobytes() == cut.circles.tobytes()
    assert jobs >= 8


def test_a_quantum_says_whether_there_was_work_and_the_work_ends() -> None:
    *_, memory = memories()
    polygons = memory.polygons
    polygons["unseen"][polygons["status"] != FREE] = RESERVOIR
    quanta = 0
    while quantum(memory):
        quanta += 1
        assert quanta < 5_000
    assert quanta > 0
    assert memory.s[0].job.kind == NO_JOB
    before = polygons.tobytes()
    assert not quantum(memory)
    assert polygons.tobytes() == before
    located = polygons[(polygons["status"] != FREE) & (polygons["covariance"]["xx"] > 0.0)]
    for box in halls("boxes", 0)[0].world.box:
        assert np.hypot(located["x"] - box.x_m, located["y"] - box.y_m).min() < 0.1 * FT


def test_an_empty_memory_leaves_nothing_to_do() -> None:
    memory = Memory(24, 1)
    assert not quantum(memory)
    assert not memory.polygons.view(np.uint8).any()


def test_the_best_pose_is_that_of_the_search() -> None:
    memory = Memory(24, 1)
    job = memory.s[0].job
    job.search.x, job.search.y, job.search.heading, job.search.log_likelihood_ratio = 1.0, 2.0, 3.0, 4.0
    keep_best(memory.s)
    assert (job.best.x, job.best.y, job.best.heading, job.best_nat) == (1.0, 2.0, 3.0, 4.0)
