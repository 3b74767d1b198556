"""Check of the numbers in a keyframe's state of perception against their bounds, before that state is restored.

The bounds stand beside the numbers, in perception; see `perception.bounds`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from perception.bounds import Bound, check_values
from perception.snapshot import Snapshot, is_scratch, numbers_of


def check_snapshot(snapshot: Snapshot, fresh: Snapshot, bounds: Mapping[str, Bound]) -> None:
    """Check every number of perception's state.

    `fresh` is the state in which a run with these settings starts, of the same names, dtypes and shapes; `bounds` are
    those of `perception.snapshot.bounds_of` for them.

    Raises
    ------
    ValueError
        A number is out of its bound, or has none.
    """
    for (name, values), (_, at_start) in zip(numbers_of(snapshot), numbers_of(fresh), strict=True):
        if is_scratch(name):
            continue
        bound = bounds.get(name)
        if bound is None:
            raise ValueError(f"{name} has no bound: declare one beside it (perception.bounds)")
        if bound.constant:
            if not np.allclose(values, at_start, rtol=1e-9, atol=1e-9):
                raise ValueError(f"{name} is not what the settings give")
        else:
            check_values(name, values, bound)
