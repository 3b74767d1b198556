"""The contract of motion, on the shipped families and the example."""

from drivers.contract.motion import *  # noqa: F403 - its tests, which run on plug-ins as well
