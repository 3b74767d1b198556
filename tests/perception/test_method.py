"""The method that the settings name."""

from __future__ import annotations

import pytest

from config.load import load_settings
from perception.bayes.bayes_method import BayesPerception
from perception.method import make_method
from perception.paper.paper_method import PaperPerception


@pytest.mark.parametrize(("name", "kind"), [("paper", PaperPerception), ("bayes", BayesPerception)])
def test_the_settings_name_the_method(name: str, kind: type) -> None:
    chosen = load_settings("hallway", [f"perception.method={name}"])
    assert isinstance(make_method(chosen.ring, chosen.models, chosen.perception), kind)
