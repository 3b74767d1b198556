from collections.abc import Callable

import pytest

from config.load import load_settings
from config.settings import Settings
from runtime.support.kernel_cache import compiled_signatures
from runtime.support.localization_warmup import correct_drift, find_echo_lag, find_in_room


@pytest.mark.compiled
@pytest.mark.parametrize("run", [correct_drift, find_echo_lag, find_in_room])
def test_a_second_time_compiles_nothing(run: Callable[[Settings], None]) -> None:
    settings = load_settings()
    run(settings)
    compiled = compiled_signatures()
    run(settings)
    assert compiled_signatures() == compiled > 0
