"""The page of a study: what is in it, and that nothing in it becomes markup."""

from __future__ import annotations

from html.parser import HTMLParser

from config.study import StudyConfig, VaryConfig
from runtime.batch.dispatch import Unfinished
from runtime.batch.outcome import Combination
from runtime.batch.report import best_rows, number, shown_value, sweep_page
from runtime.batch.runs import Run

STUDY = StudyConfig(
    worlds=("a<b.toml",),
    seeds=3,
    objectives=("recall", "false"),
    vary=(VaryConfig(setting="x.y", values=(1, 2)), VaryConfig(setting="x.on", values=(True, False))),
)
FOUND = [
    Combination(
        {"x.y": y, "x.on": on}, 3, 0, {"recall": 0.25 * y + 0.1 * on, "false": float(y), "mean_error_m": 0.01}
    )
    for y in (1, 2)
    for on in (True, False)
]


class Words(HTMLParser):
    """Collects the text of a page, and its tags."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.tags: set[str] = set()
        self.feed(text)

    def handle_data(self, data: str) -> None:
        self.words.append(data.strip())

    def handle_starttag(self, tag: str, attrs: object) -> None:
        del attrs
        self.tags.add(tag)


def test_the_page_names_the_best_and_what_did_not_finish() -> None:
    run = Run("k", "world", "a<b.toml", 2, "{}", varied={"x.y": 2, "x.on": True})
    text = sweep_page("my <study>", STUDY, 13, FOUND, [Unfinished(run, "<script>")])
    shown = Words(text)
    assert {"12 of 13", "my <study>", "<script>", "x.y = 2, x.on = true"} <= set(shown.words)
    assert "script" not in shown.tags
    assert text.count("<figure>") == 1 + 2, "a trade-off, and the effects on each objective"
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org", "")


def test_a_page_of_nothing() -> None:
    assert "No run is finished yet." in Words(sweep_page("x", STUDY, 12, [], [])).words


def test_rows_are_ordered_and_short() -> None:
    headings, rows = best_rows(STUDY, FOUND, 2)
    assert headings == ["x.y", "x.on", "recall", "false", "runs", "failed"]
    assert rows == [["2", "true", "0.6", "2", "3", "0"], ["2", "false", "0.5", "2", "3", "0"]]
    assert (shown_value("text"), shown_value(1.5), number(None), number(1 / 3)) == ("text", "1.5", "", "0.3333")
