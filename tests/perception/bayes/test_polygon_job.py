"""Work on polygons in quanta: each is bounded, and what comes of it does not depend on where it was cut."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from config.load import load_settings
from perception.bayes.bayes_method import BayesPerception
from perception.bayes.kernel_settings import make_settings
from perception.bayes.polygon_initiation import GATHERING, next_birth, try_polygon
from perception.bayes.polygon_job import BIRTH, JOB, NO_JOB, QUANTUM, TRACK, cost
from perception.bayes.polygon_tracks import next_track, pquantum, refine_polygon
from perception.bayes.state import ASKED, DIRTY, FREE, PB, PCAP, PT, PX, PXX, PY, ST, State, make_state
from perception.pipeline import Perception
from runtime.simulation.open_loop import perceive
from runtime.simulation.scenes import halls, readings

pytestmark = pytest.mark.compiled

FT = 0.3048
SETTINGS = load_settings("hallway", ["perception.method=bayes"], models=("semicircle", "box"))
P = make_settings(SETTINGS.ring, SETTINGS.models, SETTINGS.perception.bayes)
THRESHOLD = SETTINGS.perception.bayes.fresh_share
POSE_MAX = cost(PB * PCAP, 1, 4)
"""What weighing one pose costs at most."""
STEP_MAX = 2 * POSE_MAX + (len(P.radii) + 1) * POSE_MAX + GATHERING
"""No step that cannot be cut costs more."""


def copy(s: State) -> State:
    return State._make(np.copy(array) for array in s)


def memories() -> Iterator[State]:
    """Memories of a drive past boxes, here and there on the way, between two jobs."""
    hall = next(h for h in halls("boxes", 0) if h.world.acoustics.model == "specular")
    perception = Perception(SETTINGS.ring, SETTINGS.models, SETTINGS.perception)
    assert isinstance(perception.method, BayesPerception)
    for k, firing in enumerate(readings(SETTINGS.ring, hall, 0)):
        perceive(perception, firing)
        if k > 20 and k % 4 == 0:
            s = copy(perception.method.memory)
            while s.job[JOB] != NO_JOB:
                pquantum(s, P, THRESHOLD)
            yield s


def work_off(s: State, left: int) -> list[int]:
    """Finish the job in steps that may each cost `left`; return what they did cost."""
    spent = []
    while s.job[JOB] != NO_JOB:
        step = refine_polygon if s.job[JOB] == TRACK else try_polygon
        spent.append(step(s, P, left))
        assert len(spent) < 100_000
    return spent


def test_a_step_costs_what_is_left_or_the_least_there_is() -> None:
    kinds = {BIRTH: 0, TRACK: 0}
    for s in memories():
        for begin in (lambda m: next_track(m, P, THRESHOLD), next_birth):
            if begin(s):
                kinds[int(s.job[JOB])] += 1
                spent = work_off(s, QUANTUM)
                assert min(spent) > 0
                assert max(spent) <= QUANTUM + STEP_MAX
    assert min(kinds.values()) >= 3
    assert STEP_MAX < QUANTUM


def test_what_comes_of_a_job_does_not_depend_on_where_it_was_cut() -> None:
    jobs = 0
    for s in memories():
        for begin in (lambda m: next_track(m, P, THRESHOLD), next_birth):
            whole, cut = copy(s), copy(s)
            if begin(whole):
                jobs += 1
                assert begin(cut)
                assert len(work_off(whole, 10**9)) < len(work_off(cut, 1))
                for name in ("pi", "pf", "pbins", "pbn", "ti", "tf"):
                    assert np.array_equal(getattr(whole, name), getattr(cut, name)), name
    assert jobs >= 8


def test_a_quantum_says_whether_there_was_work_and_the_work_ends() -> None:
    *_, s = memories()
    s.pi[s.pi[:, ST] != FREE, DIRTY] = PB * PCAP
    quanta = 0
    while pquantum(s, P, THRESHOLD):
        quanta += 1
        assert quanta < 5_000
    assert quanta > 0
    assert s.job[JOB] == NO_JOB
    before = copy(s)
    assert not pquantum(s, P, THRESHOLD)
    assert np.array_equal(before.pf, s.pf)
    placed = s.pf[(s.pi[:, ST] != FREE) & (s.pf[:, PXX] > 0.0)]
    for box in halls("boxes", 0)[0].world.box:
        assert np.hypot(placed[:, PX] - box.x_m, placed[:, PY] - box.y_m).min() < 0.1 * FT


def test_nothing_remembered_is_nothing_to_do() -> None:
    s = make_state(24, P)
    assert s.pi.shape[0] == PT
    assert s.asked.shape[0] == ASKED
    assert not pquantum(s, P, THRESHOLD)
    assert math.isclose(float(np.abs(s.pf).sum()), 0.0)
