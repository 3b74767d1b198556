"""The layout of the settings: the same for every library, with room for every ring."""

from __future__ import annotations

from config.load import load_settings
from config.robot import LISTEN_MAX_M
from perception.bayes.inference.kernel_settings import make_settings
from perception.bayes.memory.settings_record import RANGE_BINS, RANGE_BINS_PER_M, Settings
from perception.records import array_of


def test_settings_of_different_libraries_have_one_layout_so_that_kernels_are_compiled_once() -> None:
    shapes = set()
    for models in (("semicircle",), ("box",), ("semicircle", "box")):
        it = load_settings("hallway", models=models)
        array = array_of(make_settings(it.ring, it.models, it.perception.bayes))
        shapes.add((array.dtype, array.shape))
    assert shapes == {(Settings.DTYPE, (1,))}


def test_every_range_of_the_longest_ring_has_a_bin() -> None:
    assert int(LISTEN_MAX_M * RANGE_BINS_PER_M) in {RANGE_BINS - 1, RANGE_BINS}
    assert RANGE_BINS >= LISTEN_MAX_M * RANGE_BINS_PER_M
