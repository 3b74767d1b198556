"""The contract of measuring, on the shipped families and the example."""

from drivers.contract.measuring import *  # noqa: F403 - its tests, which run on plug-ins as well
