"""The options of commands on finished runs."""

from __future__ import annotations

from runtime.analysis.timeline_sources import TimelineSource
from runtime.cli.source_options import SourceOptions


def test_the_options_of_a_source_go_to_the_analysis() -> None:
    options = SourceOptions(world="hallway", robot="denning", models=("drum",))
    source = options.timeline_source("log.csv", ("cycle.rate_hz=10",))
    assert source == TimelineSource("log.csv", ("cycle.rate_hz=10",), "denning", ("drum",), "hallway")
