"""The report of a comparison: tables, pictures and a page, all from its loaded results.

sections       models, data sets and scores, sorted by what was fitted
verdict, questions, families, memory, loops, shooting_results, reliability    facts and decisions
templates      their words; render: fills them
numbers        numbers as text; estimates: those of shooting
tables         one table as Markdown, LaTeX and for the terminal
*_table(s)     the tables of a report
figures        the pictures: one kind in each file, panels and style are shared
verdict        which model the evidence supports: candidates, plausibility, questions, document
console        where results are printed, and the same as text
exhibits       which tables and figures there are; recommended: the model of the verdict
html           the page index.html; summary: summary.md; write: all files; terminal: what is printed
diagnostics, tuning    a verdict of `check`, and the outcome of `tune`
"""

from frictionid.report.terminal import (
    results_json,
    show,
    show_fit,
    show_refined,
    show_scores,
    show_side_by_side,
    show_summary,
    side_by_side_json,
)
from frictionid.report.write import build

__all__ = [
    "build",
    "results_json",
    "show",
    "show_fit",
    "show_refined",
    "show_scores",
    "show_side_by_side",
    "show_summary",
    "side_by_side_json",
]
