"""The report of a comparison: tables, pictures and a page, all from its loaded results.

sections       models, data sets and scores, sorted by what was fitted
candidates, plausibility, questions, memory, shooting_results    facts and decisions
verdict        which model the evidence supports; its document
templates      their words; tables: fills them, and one table as Markdown, LaTeX, for the terminal
numbers        numbers as text, and those of shooting
*_table(s)     the tables of a report
figures        the pictures by theme: scores, curves, motion, fits, studies; style: what they share
exhibits       which tables and figures there are
write          all files: index.html with its charts, summary.md with warnings, tables, figures
terminal       where results are printed, the same as text, and what is printed
diagnostics    a verdict of `check`; experiment_design: a designed motion, both with pictures
sensitivity    outcomes of `sensitivity` and of `tune`
"""

from .terminal import (
    results_json,
    show,
    show_fit,
    show_refined,
    show_scores,
    show_side_by_side,
    show_summary,
    show_torque_left,
    side_by_side_json,
)
from .write import build
