"""The contract of failures, on the shipped families and the example."""

from drivers.contract.failing import *  # noqa: F403 - its tests, which run on plug-ins as well
