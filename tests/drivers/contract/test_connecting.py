"""The contract of connecting, on the shipped families and the example."""

from drivers.contract.connecting import *  # noqa: F403 - its tests, which run on plug-ins as well
