"""The search among settings: which values to try next, after what was found with others."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple, Protocol

from config.errors import WRONG_CALL, UserError
from config.study import Value, VaryConfig

RANDOM_TRIALS: Final = 12
"""Trials at random before the first that follows from others."""
DIGITS: Final = 4
"""Significant digits of a value: what is tried is what is written."""


class Asked(NamedTuple):
    """Values to try."""

    number: int
    values: Mapping[str, Value]


class Search(Protocol):
    """Proposes values. The same calls in the same order give the same proposals, so that a search can go on."""

    def ask(self) -> Asked:
        """Return the next values to try."""
        ...

    def tell(self, number: int, cost: float) -> None:
        """Note the cost of a trial; infinity if it has none."""
        ...


class OptunaSearch:
    """Optuna's tree-structured Parzen estimator (Bergstra et al. 2011), with all settings in one density.

    The present values are tried first if they are among those allowed.

    Raises
    ------
    UserError
        A setting whose value is whole has a range without a whole number.
    """

    def __init__(self, varied: Sequence[VaryConfig], present: Mapping[str, Value], seed: int) -> None:
        import optuna

        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._varied = varied
        self._whole = {
            one.setting: _whole_ends(one) for one in varied if one.range and isinstance(present.get(one.setting), int)
        }
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Optuna calls this option experimental
            sampler = optuna.samplers.TPESampler(seed=seed, n_startup_trials=RANDOM_TRIALS, multivariate=True)
        self._study = optuna.create_study(sampler=sampler)
        self._failed = optuna.trial.TrialState.FAIL
        if all(one.setting in present and allows(one, present[one.setting]) for one in varied):
            self._study.enqueue_trial({one.setting: present[one.setting] for one in varied})

    def ask(self) -> Asked:
        """Return the next values to try."""
        trial = self._study.ask()
        values: dict[str, Value] = {}
        for one in self._varied:
            if one.values:
                values[one.setting] = trial.suggest_categorical(one.setting, list(one.values))
            elif one.setting in self._whole:
                values[one.setting] = trial.suggest_int(one.setting, *self._whole[one.setting], log=one.log)
            else:
                low, high = one.range
                number = float(f"{trial.suggest_float(one.setting, low, high, log=one.log):.{DIGITS}g}")
                values[one.setting] = min(max(number, low), high)
        return Asked(trial.number, values)

    def tell(self, number: int, cost: float) -> None:
        """Note the cost of a trial; infinity if it has none."""
        if math.isfinite(cost):
            self._study.tell(number, cost)
        else:
            self._study.tell(number, state=self._failed)


def _whole_ends(one: VaryConfig) -> tuple[int, int]:
    """Return the least and the greatest whole number in a setting's range.

    Raises
    ------
    UserError
        There is none.
    """
    low, high = math.ceil(one.range[0]), math.floor(one.range[1])
    if low > high:
        raise UserError(f"{one.setting}: no whole number lies in its range: make that wider", WRONG_CALL)
    return low, high


def allows(one: VaryConfig, value: Value) -> bool:
    """Return whether a value is among those of a varied setting."""
    if one.values:
        return value in one.values
    low, high = one.range
    return isinstance(value, int | float) and low <= value <= high
