"""What a search found, in words: the changes as TOML, what they bring, the trials, and the page."""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Final

import tomli_w

from config.files import utf8
from config.study import StudyConfig, Value
from runtime import VERSION
from runtime.analysis.plots.figure_files import styled, svg_of
from runtime.analysis.plots.study_figures import search_figure
from runtime.analysis.report.html_parts import note, section, settings_list, table, tile
from runtime.batch.dispatch import Unfinished
from runtime.batch.outcome import MORE_IS_BETTER
from runtime.batch.report import about, figure_block, html_document, number, shown_value, unfinished_table
from runtime.batch.rows import FIGURES
from runtime.batch.tuning import Difference, Tuned

UNCHECKED: Final = "nothing was held out, so the gain is that of the search itself, which flatters it"


def change_lines(tuned: Tuned, present: Mapping[str, Value]) -> list[str]:
    """Return a line for each setting to change, with its present value."""
    return [f"{name}: {_present(present, name)} → {shown_value(value)}" for name, value in tuned.best.values.items()]


def gain_lines(tuned: Tuned) -> list[str]:
    """Return a line for each figure that was compared: on what was held out, or else on what was searched with."""
    return [f"{one.objective}: {number(one.present)} → {number(one.tuned)}, {_gain(one)}" for one in _judged(tuned)]


def judgement(tuned: Tuned) -> str:
    """Return in one line whether the changes are better."""
    if not tuned.best.values:
        return "no change is better than the present settings: keep them"
    if not tuned.held_out:
        return UNCHECKED
    first = tuned.held_out[0]
    if math.isinf(first.half_width):
        return f"too few runs were held out to say whether that is chance ({first.runs}): tune with more"
    better = (first.mean > 0.0) == (first.objective in MORE_IS_BETTER)
    if first.is_known and better:
        return f"the changes are better in what was held out ({first.runs} runs)"
    if first.is_known:
        return f"the changes are worse in what was held out ({first.runs} runs): keep the present settings"
    return (
        f"what was held out ({first.runs} runs) shows no difference beyond chance: keep the present settings, or "
        "tune with more recordings or seeds"
    )


def changes_text(name: str, study: StudyConfig, tuned: Tuned) -> str:
    """Return the changed settings as TOML, which a run file may contain, after what they bring as a comment."""
    tables: dict[str, Any] = {}
    for setting, value in tuned.best.values.items():
        *path, key = setting.split(".")
        at = tables
        for part in path:
            at = at.setdefault(part, {})
        at[key] = value
    lines = [
        f"Changes that `echolocate tune {utf8(name)}` found for {about(study)} (version {VERSION}).",
        "Copy them into the run file; tables of a robot file, as [ring], may stand there as well.",
        *gain_lines(tuned),
        judgement(tuned),
    ]
    return "".join(f"# {line}\n" for line in lines) + "\n" + tomli_w.dumps(tables)


def trials_text(study: StudyConfig, tuned: Tuned) -> str:
    """Return all trials as CSV: number, values, runs, failed drives, mean figures, cost; trial 0 is the present."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = [one.setting for one in study.vary]
    writer.writerow(["trial", *names, "runs", "failed", *FIGURES, "cost"])
    for i, trial in enumerate((tuned.present, *tuned.trials)):
        found = trial.figures
        counts = ["", ""] if found is None else [found.runs, found.failed]
        figures = ["" if found is None else found.figures.get(name, "") for name in FIGURES]
        values = [trial.values.get(name, "") for name in names]
        writer.writerow([i, *values, *counts, *figures, trial.cost if math.isfinite(trial.cost) else ""])
    return text.getvalue()


def tuning_page(
    name: str, study: StudyConfig, present: Mapping[str, Value], tuned: Tuned, unfinished: Sequence[Unfinished]
) -> str:
    """Return the page as one HTML text that refers to nothing outside itself.

    `study` has the settings that were searched, and `present` their present values.
    """
    title = escape(utf8(name))
    judged = _judged(tuned)
    gained = f"{number(judged[0].present)} → {number(judged[0].tuned)}" if judged else "none"
    named = judged[0].objective if judged else study.objectives[0]
    changes = [
        [setting, _present(present, setting), shown_value(value)] for setting, value in tuned.best.values.items()
    ]
    idle = ", ".join(tuned.dropped)
    body = "".join(
        (
            f'<h1>{title}</h1><p class="sub">{escape(about(study))}, version {escape(VERSION)}</p>',
            f'<div class="tiles">{tile(str(len(tuned.trials)), "trials")}{tile(str(len(changes)), "changes")}'
            f"{tile(gained, named)}</div>",
            section(
                "Changes",
                table(["setting", "present", "tuned"], changes) if changes else "",
                note(f"{judgement(tuned).capitalize()}."),
                note(f"Left as they were, for a change brought nothing: {idle}.") if idle else "",
            ),
            section("Held out", _table(tuned.held_out)),
            section(
                "Searched with",
                _table(tuned.searched),
                note("The search chose the settings by these runs, so they flatter the result.")
                if tuned.searched
                else "",
            ),
            section("The search", _course(tuned, study.objectives[0])),
            section("Without a result", unfinished_table(unfinished)),
            section("Study", settings_list(study)),
        )
    )
    return html_document(title, body)


def _judged(tuned: Tuned) -> Sequence[Difference]:
    return tuned.held_out or tuned.searched


def _present(present: Mapping[str, Value], name: str) -> str:
    return shown_value(present[name]) if name in present else "not set"


def _gain(one: Difference) -> str:
    if math.isinf(one.half_width):
        return f"{one.mean:+.3g} (too few runs to say how sure: {one.runs})"
    return f"{one.mean:+.3g} ± {one.half_width:.2g} (95 %, {one.runs} runs)"


def _table(differences: Sequence[Difference]) -> str:
    rows = [[one.objective, number(one.present), number(one.tuned), _gain(one)] for one in differences]
    return table(["figure", "present", "tuned", "difference"], rows) if rows else ""


def _course(tuned: Tuned, objective: str) -> str:
    """Return the figure of the cost of all trials, and of the best so far."""
    known = [(i, one.cost) for i, one in enumerate((tuned.present, *tuned.trials)) if math.isfinite(one.cost)]
    best = list(itertools.accumulate((cost for _, cost in known), min))
    with styled(text_as_text=True):
        svg = svg_of(search_figure(known, best))
    return figure_block(svg, "search", f"cost of each trial (less is better, mostly {objective}) and the best so far")
