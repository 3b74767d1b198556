"""Polygon hypotheses: a side is laid on a segment, requests wait in a queue, and the best trial starts a track."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config.load import load_model
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.elements import REQUESTS_MAX
from perception.bayes.memory.job_records import INITIATION, NO_JOB
from perception.bayes.memory.polygon_parameters import CHALLENGE_UNSEEN, QUANTUM_COST
from perception.bayes.memory.scratch import POLYGON
from perception.bayes.memory.state import ESTABLISHED, FREE, PLACED, TENTATIVE, Memory, PolygonTrack
from perception.bayes.polygons import initiation
from perception.kernel import Floats
from perception.records import records, zeros
from tests.perception.bayes.box_readings import LEVEL, SETTINGS, P, S, heard
from tests.perception.bayes.random_tracks import SENSORS, TRACKS, history

INNER = float(S.polygons[0].inner_radius_m)
CHAIN = load_model("box").model_copy(
    update={"name": "chain", "vertices_m": ((0.0, -0.5), (0.4, 0.0), (0.0, 0.5)), "closed": False}
)
OPEN = make_settings(SETTINGS.ring, [CHAIN], SETTINGS.perception.bayes)


def new_memory() -> Memory:
    """Return an empty memory with the assumed noise of the readings."""
    memory = Memory(SENSORS, TRACKS)
    memory.s[0].noise_level = LEVEL
    return memory


def hypothesis(memory: Memory) -> tuple[float, float, float]:
    """Return the scratch's hypothesis."""
    at = memory.s[0].scratch.hypothesis
    return float(at.x), float(at.y), float(at.heading)


@pytest.mark.parametrize("shift", [-0.3, 0.0, 0.3])
@pytest.mark.parametrize("side", [0, 1, 2, 3])
def test_a_laid_side_lies_on_the_segment_and_faces_its_sensors(side: int, shift: float) -> None:
    memory, place, normal = new_memory(), complex(0.3, -0.4), complex(math.cos(2.0), math.sin(2.0))
    initiation.lay_side(memory.s, P, 0, side, shift, place.real, place.imag, normal.real, normal.imag)
    x, y, heading = hypothesis(memory)
    it, turn = S.polygons[0].sides[side], complex(math.cos(heading), math.sin(heading))
    tangent = complex(it.tangent_x, it.tangent_y)
    middle = complex(it.x, it.y) + (0.5 + shift) * it.length * tangent
    assert abs(complex(x, y) + middle * turn - place) < 1e-12
    assert abs(-1j * tangent * turn + normal) < 1e-12, "the outside faces against the segment's normal"


def test_a_closed_outline_lies_on_each_distinct_side_and_an_open_one_on_both_faces() -> None:
    assert initiation.ways_to_lie(P, 0) == 4 // int(S.polygons[0].symmetry)
    assert initiation.ways_to_lie(OPEN, 0) == 4


def test_a_request_is_made_once_and_the_newest_is_tried_first() -> None:
    memory = new_memory()
    job = memory.s[0].job

    def request(x: float, angle: float = 0.0, model: int = 0) -> int:
        return initiation.request_polygon(memory.s, model, x, 0.0, math.cos(angle), math.sin(angle))

    assert request(0.0) == 1
    assert request(0.07) == 0, "near and parallel"
    assert request(0.07, angle=0.25) == 1
    assert request(0.0, model=1) == 1
    assert request(0.08) == 1
    assert job.requests_made == 4
    order = []
    while initiation.next_request(memory.s):
        assert (job.kind, job.stage, job.next_step, job.noise_level) == (INITIATION, initiation.LAY, 0, LEVEL)
        order.append((float(job.segment_x), int(job.model)))
    assert order == [(0.08, 0), (0.0, 1), (0.07, 0), (0.0, 0)]
    for k in range(REQUESTS_MAX):
        assert request(10.0 + k) == 1
    assert request(0.0) == 1, "the old request was replaced"


@pytest.mark.parametrize(
    ("status", "hits", "model", "apart", "is_occupied"),
    [
        (ESTABLISHED, 19.0, 0, 1.4, True),
        (ESTABLISHED, 19.0, 0, 1.6, False),
        (ESTABLISHED, 17.0, 0, 0.6, False),
        (TENTATIVE, 19.0, 0, 0.6, False),
        (TENTATIVE, 19.0, 0, 0.4, True),
        (TENTATIVE, 19.0, 1, 0.4, False),
        (FREE, 19.0, 0, 0.4, False),
    ],
)
def test_a_track_occupies_a_wider_place_where_it_explains_its_readings(
    status: int, hits: float, model: int, apart: float, is_occupied: bool
) -> None:
    memory = new_memory()
    track = memory.s[0].polygons[5]
    track.status, track.hits, track.near, track.model, track.x = status, hits, 20.0, model, apart * INNER
    assert initiation.occupant(memory.s, P, 0, 0.0, 0.0) == (5 if is_occupied else -1)


def test_a_reset_track_keeps_only_its_number_its_marks_and_the_readings_in_its_bins() -> None:
    array = zeros(PolygonTrack, 2)
    array.view(np.int64)[...] = np.arange(1, 1 + array.nbytes // 8)
    before = array.copy()
    initiation.reset_polygon(records(PolygonTrack, array)[0])
    kept = {"number", "marks", "bins"}
    for name in PolygonTrack.DTYPE.names or ():
        if name not in kept:
            assert not np.array(array[0][name]).tobytes().strip(b"\0"), name
    assert all(array[0][name] == before[0][name] for name in ("number", "marks"))
    assert not array[0]["bins"]["count"].any()
    assert array[1] == before[1]


def remember(memory: Memory, w: Floats) -> None:
    """Put readings into the sensors' histories."""
    for i in range(SENSORS):
        rows = w[i::SENSORS]
        history(memory, i)[: len(rows)] = rows
        memory.s[0].sensors[i].kept = len(rows)


def run_job(memory: Memory, pose: Floats) -> None:
    """Request a box behind its face that looks along −x in its own frame, and finish the job."""
    turn = complex(math.cos(pose[2]), math.sin(pose[2]))
    face = complex(pose[0], pose[1]) - INNER * turn
    assert initiation.request_polygon(memory.s, 0, face.real, face.imag, turn.real, turn.imag) == 1
    assert initiation.next_request(memory.s)
    while memory.s[0].job.kind != NO_JOB:
        initiation.advance_initiation(memory.s, P, QUANTUM_COST)


def test_a_box_is_started_where_its_readings_are_and_challenged_when_it_is_found_again() -> None:
    rng, memory, pose = np.random.default_rng(35), new_memory(), np.array([0.3, -0.2, 0.1])
    remember(memory, heard(rng, pose, 40, 0.0, 1))
    run_job(memory, pose)
    track = memory.s[0].polygons[0]
    assert (track.status, track.number, track.model) == (TENTATIVE, 1, 0)
    unseen = int(track.unseen)
    assert 30 < unseen <= 40
    assert math.dist((track.x, track.y), pose[:2]) < 0.03
    assert abs(math.remainder(track.heading - pose[2], 0.5 * math.pi)) < 0.06
    assert track.log_likelihood_ratio > 50.0
    memory.state["requests"]["is_done"] = 1
    memory.state["job"]["requests_made"] = 0
    run_job(memory, pose)
    assert (track.has_challenger, track.unseen) == (1, unseen + CHALLENGE_UNSEEN)
    assert math.dist((track.challenger.x, track.challenger.y), pose[:2]) < 0.03
    assert np.count_nonzero(memory.polygons["status"]) == 1


def test_a_box_is_not_started_where_a_user_rejected_it_or_without_readings() -> None:
    rng, memory, pose = np.random.default_rng(35), new_memory(), np.array([0.3, -0.2, 0.1])
    run_job(memory, pose)
    assert not memory.polygons["status"].any()
    memory.state["job"]["requests_made"] = 0
    remember(memory, heard(rng, pose, 40, 0.0, 1))
    memory.state["rejections"][0, 0] = (0.3, -0.2, 0.2, POLYGON, 1e9)
    memory.state["rejection_count"] = 1
    run_job(memory, pose)
    assert not memory.polygons["status"].any()


def test_where_no_track_is_free_no_box_is_started() -> None:
    memory = new_memory()
    memory.polygons["status"], memory.polygons["marks"] = TENTATIVE, PLACED
    before = memory.polygons.tobytes()
    initiation.start_polygon(memory.s, 0, 0.0, 0.0, 0.0, 30.0)
    assert memory.polygons.tobytes() == before
    assert memory.state["objects_numbered"][0] == 0


def test_too_many_readings_are_thinned_evenly() -> None:
    memory = new_memory()
    capacity = len(memory.s[0].job_readings)
    w = np.tile((0.0, 0.0, 1.0, 0.0, 1.0), (SENSORS * 28, 1))
    w[:, 1] = np.linspace(-0.05, 0.05, len(w))
    remember(memory, w)
    n = initiation.gather_job_readings(memory.s, P, 0, 1.0, 0.0)
    assert n == capacity < len(w)
    heard_at = memory.state["job_readings"]["y"][0]
    everything = np.concatenate([w[i::SENSORS, 1] for i in range(SENSORS)])
    assert heard_at.tolist() == [everything[j * len(w) // n] for j in range(n)]
