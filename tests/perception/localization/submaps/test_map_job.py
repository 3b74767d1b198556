"""The comparison of one map with those before: runs of maps, bounded steps, and the same outcome from any caches."""

from __future__ import annotations

import numpy as np
import pytest

from perception.localization.submaps import map_job
from perception.localization.submaps.local_grid import SUBMAP_CELLS, make_grid
from perception.localization.submaps.map_job import Maps, Outcome, match_map
from perception.localization.submaps.map_lines import find_lines
from perception.localization.submaps.pose_graph import SCALES, Link
from perception.localization.submaps.submap_records import (
    Submap,
    between,
    node_at,
    odometry_link,
    pose_of,
)
from perception.records import zeros
from tests.perception.localization.submaps.test_local_grid import BEAM
from tests.perception.localization.submaps.test_map_match import room_readings
from tests.perception.localization.submaps.test_submap_records import matched

INFORMATION = np.diag([400.0, 400.0, 900.0])


def two_maps(error: tuple[float, float, float] = (0.1, -0.05, 0.03)) -> Maps:
    """Two maps of a room from poses a little apart; odometry's second one is wrong."""
    moved = np.array([0.3, 0.2, 0.1])
    submaps = zeros(Submap, 2)
    for k, readings in enumerate((room_readings(), room_readings(*moved))):
        submaps[k]["count"] = len(readings)
        submaps[k]["readings"][: len(readings)] = readings
    submaps[1]["pose"] = moved + error
    nodes = np.concatenate([node_at(submaps[k]["pose"]) for k in range(2)])
    links = odometry_link(0, moved + error, np.diag([50.0, 50.0, 200.0]))
    return Maps(submaps, nodes, links, np.zeros(SCALES), np.array([-70.0, 100.0]), {}, {})


@pytest.mark.compiled
def test_a_map_is_matched_with_the_one_before() -> None:
    *steps, outcome = match_map(two_maps(), BEAM)
    *first, alone = match_map(two_maps()._replace(links=zeros(Link, 0)), BEAM)
    assert set(steps) == {None}
    assert len(first) > 0
    assert isinstance(outcome, Outcome)
    assert isinstance(alone, Outcome)
    assert outcome.links["is_match"].tolist() == [0, 1]
    assert outcome.gain > 0.0
    off = np.abs(pose_of(outcome.nodes[1]) - (0.3, 0.2, 0.1))
    assert np.all(off < (0.05, 0.05, 0.03))


@pytest.mark.compiled
def test_caches_change_nothing() -> None:
    cold, warm = two_maps(), two_maps()
    *_, warm.grids[0] = make_grid(np.array(room_readings()), BEAM)
    *_, warm.lines[0] = find_lines(np.array(room_readings()), BEAM)
    *mine, one = match_map(cold, BEAM)
    *its, other = match_map(warm, BEAM)
    assert len(mine) == len(its)
    assert isinstance(one, Outcome)
    assert isinstance(other, Outcome)
    assert one.nodes.tolist() == other.nodes.tolist()
    assert cold.grids[0].shape == (2, SUBMAP_CELLS, SUBMAP_CELLS)
    assert cold.lines[0].tolist() == warm.lines[0].tolist()


def test_the_first_map_has_nothing_to_be_compared_with() -> None:
    maps = two_maps()
    alone = Maps(zeros(Submap, 1), maps.nodes[:1], zeros(Link, 0), np.zeros(SCALES), np.array([-70.0, 100.0]), {}, {})
    *_, outcome = match_map(alone, BEAM)
    assert isinstance(outcome, Outcome)
    assert outcome.gain == 0.0


def test_runs_are_consecutive_and_short() -> None:
    assert map_job._runs([0, 1, 2, 5, 6, 9]) == [[0, 1, 2], [5, 6], [9]]
    assert [len(run) for run in map_job._runs(list(range(20)))] == [8, 8, 4]


def test_way_that_all_matches_lose_refutes_no_odometry() -> None:
    """Matches of maps of round bodies come out short, since only the side that was seen is in the map."""
    submaps = zeros(Submap, 9)
    submaps["pose"] = [(0.6 * k, 0.3 * k * k / 9.0, 0.2 * k) for k in range(9)]
    moved = [(k, k + 3, between(submaps["pose"][k], submaps["pose"][k + 3])) for k in range(6)]
    nodes = np.concatenate([node_at(pose) for pose in submaps["pose"]])

    def cost(factor: float, turn: float) -> float:
        links = [
            matched(of, to, pose * (factor, factor, 1.0) + (0.0, 0.0, turn), INFORMATION, is_next=False)
            for of, to, pose in moved
        ]
        maps = Maps(submaps, nodes, np.concatenate(links), np.zeros(SCALES), np.array([-70.0, 100.0]), {}, {})
        return map_job._cost_at_odometry(maps, np.empty((6, 3, 6 + SCALES)), np.empty((6, 3)))

    assert cost(0.99, 0.0) < 0.1
    assert cost(0.95, 0.0) < 5.0
    assert cost(0.99, 0.2) > 20.0
