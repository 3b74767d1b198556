"""Another value for a tuned number: what is computed from it follows, and only kernels that depend on it change."""

from __future__ import annotations

import subprocess
import sys

import orjson
import pytest

from bench.varied_source import TunedNumber, kernel_digests, tuned_numbers, vary
from perception.bayes.memory import parameters
from perception.mapping.grid import sight_lines

pytestmark = pytest.mark.compiled
MODULE = parameters.__name__
SHARE = TunedNumber(MODULE, "OUTLIER_SHARE", parameters.OUTLIER_SHARE)
CHANGED = """
import sys, orjson
from bench.varied_source import TunedNumber, kernel_digests, vary
vary(TunedNumber("perception.mapping.grid.sight_lines", "RAYS", 8))
digests = kernel_digests()
from perception.mapping.grid import sight_lines
sys.stdout.buffer.write(orjson.dumps([digests, sight_lines.RAYS, sight_lines.LOCATED_RAD]))
"""


def varied_digests() -> tuple[dict[str, str], int, float]:
    done = subprocess.run([sys.executable, "-c", CHANGED], capture_output=True, check=True)
    found, rays, located = orjson.loads(done.stdout)
    return found, rays, located


def test_numbers_are_found_with_their_other_values() -> None:
    numbers = {(one.module, one.name): one for one in tuned_numbers("perception")}
    assert numbers[MODULE, "OUTLIER_SHARE"] == SHARE
    assert SHARE.variants() == (0.7 * SHARE.value, 1.4 * SHARE.value)
    assert TunedNumber("m", "ROUNDS", 3).variants() == (2, 4)
    assert TunedNumber("m", "KEPT", 20).variants() == (14, 28)


@pytest.mark.soak
def test_only_kernels_that_depend_on_a_number_change() -> None:
    shipped, (varied, other, same) = kernel_digests(), varied_digests()
    assert (other, same) == (8, sight_lines.LOCATED_RAD) != (sight_lines.RAYS, sight_lines.LOCATED_RAD)
    assert varied.keys() <= shipped.keys(), "here other tests have imported more"
    changed = {name for name in varied if shipped[name] != varied[name]}
    assert {name.rpartition(".")[0] for name in changed} == {"perception.mapping.grid.sight_lines"}


def test_a_module_that_is_imported_already_cannot_be_changed() -> None:
    with pytest.raises(RuntimeError, match="imported already"):
        vary(SHARE)
