"""The page of a study: the best combinations, what each setting changes, trade-offs, and what did not finish."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from html import escape
from typing import Final

from config.files import utf8
from config.study import Objective, StudyConfig, Value
from runtime import VERSION
from runtime.analysis.plots.figure_files import styled, svg_of
from runtime.analysis.plots.study_figures import effects_figure, trade_off_figure
from runtime.analysis.report.html_parts import note, section, settings_list, table, tile
from runtime.analysis.report.inline_svg import inlined
from runtime.analysis.report.stylesheet import CSS
from runtime.batch.dispatch import Unfinished
from runtime.batch.outcome import Combination, Sensitivity, pareto_front, ranked, sensitivities

SHOWN: Final = 20
"""Rows of a table."""
DIGITS: Final = 4


def sweep_page(
    name: str, study: StudyConfig, runs: int, combinations: Sequence[Combination], unfinished: Sequence[Unfinished]
) -> str:
    """Return the page as one HTML text that refers to nothing outside itself.

    `runs` counts all of the study, of which `unfinished` were given up.
    """
    title = escape(utf8(name))
    done, failed = sum(one.runs for one in combinations), sum(one.failed for one in combinations)
    effects = sensitivities(study, combinations)
    body = "".join(
        (
            f'<h1>{title}</h1><p class="sub">{escape(about(study))}, version {escape(VERSION)}</p>',
            f'<div class="tiles">{tile(f"{done:,} of {runs:,}", "runs finished")}'
            f"{tile(f'{len(combinations):,}', 'combinations of settings')}"
            f"{tile(f'{failed:,}', 'drives that did not arrive')}</div>",
            section(
                "Best",
                best_table(study, combinations),
                note(
                    "Means over the runs of each combination; ordered by drives that did not arrive, then by the "
                    f"objectives: {', '.join(study.objectives)}."
                ),
            ),
            section("Trade-offs", *_trade_offs(study, combinations)),
            section("What each setting changes", *_effects(effects)),
            section("Without a result", unfinished_table(unfinished)),
            section("Study", settings_list(study)),
        )
    )
    return html_document(title, body)


def html_document(title: str, body: str) -> str:
    """Return a whole page; `title` and `body` are HTML, escaped already."""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title} · echolocate</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="generator" content="echolocate {escape(VERSION)}"><style>{CSS}</style></head>'
        f"<body><main>{body}</main></body></html>\n"
    )


def best_rows(
    study: StudyConfig, combinations: Sequence[Combination], shown: int
) -> tuple[list[str], list[list[str]]]:
    """Return headings and at most `shown` rows of the best combinations, as text."""
    settings = [vary.setting for vary in study.vary]
    rows = [
        [
            *(shown_value(one.values[setting]) for setting in settings),
            *(number(one.figures.get(objective)) for objective in study.objectives),
            str(one.runs),
            str(one.failed),
        ]
        for one in ranked(combinations, study.objectives)[:shown]
    ]
    return [*settings, *study.objectives, "runs", "failed"], rows


def best_table(study: StudyConfig, combinations: Sequence[Combination]) -> str:
    """Return the table of the best combinations."""
    return table(*best_rows(study, combinations, SHOWN)) if combinations else note("No run is finished yet.")


def shown_value(value: Value) -> str:
    """Return a value as in TOML, texts without quotes."""
    return value if isinstance(value, str) else json.dumps(value)


def number(value: float | None) -> str:
    """Return a figure in few digits; empty if it is unknown."""
    return "" if value is None else f"{value:.{DIGITS}g}"


def about(study: StudyConfig) -> str:
    """Return what a study runs, in a few words."""
    if study.recordings is not None:
        return f"recordings {utf8(study.recordings)}"
    what = "scenes" if study.scenes else "worlds"
    seeds = "1 seed" if study.seeds == 1 else f"{study.seeds:,} seeds"
    return f"{what} {', '.join(map(utf8, study.scenes or study.worlds))}; {seeds}"


def _trade_offs(study: StudyConfig, combinations: Sequence[Combination]) -> list[str]:
    """Return the figures of the first objective and each other one."""
    first, parts = study.objectives[0], []
    for other in study.objectives[1:]:
        pair: tuple[Objective, Objective] = (other, first)
        known = [one for one in combinations if all(math.isfinite(one.cost(objective)) for objective in pair)]
        if len(known) > 1:
            front = pareto_front(known, pair)
            best = ranked(known, study.objectives)[0]
            points, of_front, of_best = (
                [(one.figures[other], one.figures[first]) for one in group] for group in (known, front, [best])
            )
            with styled(text_as_text=True):
                svg = svg_of(trade_off_figure(points, of_front, of_best[0], (other, first)))
            parts.append(figure_block(svg, f"trade-{other}", f"{first} over {other}"))
    front = pareto_front(combinations, study.objectives)
    if len(study.objectives) > 1 and len(combinations) > 1:
        parts.append(
            note(
                f"In all objectives together, no other is better than {len(front)} of "
                f"{len(combinations)} combinations:"
            )
        )
        parts.append(table(*best_rows(study, front, SHOWN)))
    return parts


def _effects(effects: Sequence[Sensitivity]) -> list[str]:
    """Return for each objective the figure and the table of what each setting changes in it; nothing without any."""
    parts = []
    for objective in dict.fromkeys(effect.objective for effect in effects):
        own = [effect for effect in effects if effect.objective == objective]
        with styled(text_as_text=True):
            drawn = [(one.setting, [(shown_value(value), mean) for value, mean in one.means]) for one in own]
            svg = svg_of(effects_figure(drawn, objective))
        parts.append(figure_block(svg, f"effects-{objective}", f"{objective} by value of each setting"))
        rows = [[one.setting, f"{100.0 * one.share:.0f} %", *_extremes(one)] for one in own]
        parts.append(table([objective, "share of its variance", "least at", "", "most at", ""], rows))
    if parts:
        parts.append(
            note(
                "The share is the setting's main effect in an analysis of variance over all combinations; "
                "what is missing to 100 % are settings that act together."
            )
        )
    return parts


def _extremes(effect: Sensitivity) -> list[str]:
    least = min(effect.means, key=lambda one: one[1])
    most = max(effect.means, key=lambda one: one[1])
    return [shown_value(least[0]), number(least[1]), shown_value(most[0]), number(most[1])]


def unfinished_table(unfinished: Sequence[Unfinished]) -> str:
    """Return the table of the runs that were given up; empty if there are none."""
    if not unfinished:
        return ""
    rows = [
        [
            utf8(one.run.subject),
            "" if one.run.seed is None else str(one.run.seed),
            ", ".join(f"{name} = {shown_value(value)}" for name, value in one.run.varied.items()),
            utf8(one.reason),
        ]
        for one in unfinished[:SHOWN]
    ]
    return table(["run", "seed", "settings", "reason"], rows, text=True)


def figure_block(svg: str, name: str, caption: str) -> str:
    """Return a figure with its caption; `name` is unique on the page."""
    label = escape(caption)
    return f"<figure>{inlined(svg, name, label)}<figcaption>{label}</figcaption></figure>"
