"""The bins of a wall: what readings put there."""

from __future__ import annotations

import math

import numpy as np

from perception.bayes.walls import bins as wall_bins
from perception.bayes.walls.contact import BEAM_EDGE, FOOT, contact, wall_normal, wall_point
from tests import naive_walls
from tests.perception.bayes.random_tracks import P, examples, pair
from tests.perception.bayes.rooms import SIGMA, new_room, place_wall, reading, refit, spans


@examples(3, 40)
def test_echoes_from_feet_and_beam_edges_give_the_true_line_from_a_turned_frame(examples: int) -> None:
    rng = np.random.default_rng(43)
    memory, room = new_room()
    room.edge_echoes = 100.0
    wall = room.walls[0]
    for _ in range(examples):
        normal = rng.uniform(-3, 3)
        n, t = np.array([math.cos(normal), math.sin(normal)]), np.array([-math.sin(normal), math.cos(normal)])
        origin = rng.uniform(-0.5, 0.5, 2)
        place_wall(wall, origin, normal + rng.uniform(-0.02, 0.02), 2.0 - float(n @ origin))
        wall_bins.clear_wall(wall)
        kinds = set()
        for _ in range(150):
            distance = rng.uniform(0.8, 2.5)
            sensor = (2.0 - distance) * n + rng.uniform(-1.5, 1.5) * t
            axis = normal + rng.choice([rng.uniform(-0.2, 0.2), rng.uniform(0.3, 0.5)])
            exact, _ = naive_walls.touch(sensor, axis, 0.20943951, normal, 2.0)
            q = reading(*pair(sensor), axis, exact + rng.normal(0, SIGMA))
            kind = contact(wall, q, P)[0]
            kinds.add(kind)
            wall_bins.enter_reading(room, wall, q, kind, P)
        for _ in range(2):
            refit(memory, wall)
        nx, ny = wall_normal(wall)
        assert kinds == {FOOT, BEAM_EDGE}
        assert abs(math.atan2(n[0] * ny - n[1] * nx, n @ (nx, ny))) < math.radians(0.3)
        assert abs(np.array(wall_point(wall, 0.5 * spans(wall).sum() / max(1, len(spans(wall))))) @ n - 2.0) < 0.006
