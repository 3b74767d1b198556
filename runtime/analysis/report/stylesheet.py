"""The stylesheet of the report page: for light and dark screens, print, and phones."""

from __future__ import annotations

from typing import Final

CSS: Final = """
:root { color-scheme: light dark;
  --page: #f6f6f4; --paper: #ffffff; --ink: #1c1c1c; --muted: #6e6e6e; --grid: #e3e3e3; --truth: #cfcfcf;
  --echo: #0072b2; --segment: #d55e00; --cluster: #009e73; --robot: #cc79a7; --bad: #b3261e; }
@media screen and (prefers-color-scheme: dark) { :root {
  --page: #111315; --paper: #1a1d20; --ink: #ececec; --muted: #a2a6aa; --grid: #33383d; --truth: #5a6066;
  --echo: #56b4e9; --segment: #f28e4c; --cluster: #3ecfa4; --robot: #e3a4c6; --bad: #ff8a80; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 15px/1.5 system-ui, sans-serif; }
main { max-width: 80rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.6rem; margin: 0; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .6rem; }
p { margin: .3rem 0; } .sub, figcaption, .note { color: var(--muted); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(8.5rem, 1fr)); gap: .7rem; margin: 1.2rem 0; }
.tile, figure, .card { background: var(--paper); border: 1px solid var(--grid); border-radius: .5rem; }
.tile { padding: .6rem .8rem; } .tile b { display: block; font-size: 1.35rem; line-height: 1.3; }
.tile span { color: var(--muted); font-size: .85rem; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(34rem, 100%), 1fr)); gap: .9rem; }
figure { margin: 0; padding: .5rem; break-inside: avoid; } figure svg { display: block; width: 100%; height: auto; }
figcaption { font-size: .85rem; padding: .3rem .4rem 0; }
.card { padding: .3rem .8rem .5rem; overflow-x: auto; break-inside: avoid; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; width: 100%; }
th, td { text-align: right; padding: .28rem .6rem; border-bottom: 1px solid var(--grid); white-space: nowrap; }
th { color: var(--muted); font-weight: 600; } tr:last-child td { border-bottom: 0; }
th:first-child, td:first-child, .text td, .text th { text-align: left; } .text td { white-space: normal; }
.bad { color: var(--bad); font-weight: 600; }
.settings { columns: 21rem; column-gap: 1.5rem; font: 12px/1.45 ui-monospace, monospace; overflow-wrap: anywhere; }
.settings div { break-inside: avoid; padding-left: 1rem; text-indent: -1rem; } .settings span { color: var(--muted); }
@media print { body { background: none; font-size: 10pt; } main { max-width: none; padding: 0; }
  .figures { display: block; } figure { width: 85%; margin: 0 auto .6rem; }
  .settings { font-size: 7.5pt; columns: 3; } h2 { break-after: avoid; } }
"""
