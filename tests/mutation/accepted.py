"""Mutants that may live, each with the reason why no test should notice it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

ACCEPTED: Mapping[str, Mapping[str, str]] = MappingProxyType({})
