"""The number of examples of property tests: few in ordinary runs, in proportion more in `make soak`."""

from __future__ import annotations

from hypothesis import HealthCheck, settings


def examples(share: float, *suppressed: HealthCheck) -> settings:
    """Return settings with this share of the profile's examples: 50 in `make test`, 1000 in `make soak`.

    Parameters
    ----------
    share
        Share of the profile's number of examples.
    suppressed
        Health checks not to make, besides those of the profile.
    """
    profile = settings()
    checks = (*profile.suppress_health_check, *suppressed)
    return settings(max_examples=max(1, round(share * profile.max_examples)), suppress_health_check=checks)
