"""What a person reads of a comparison: tables, pictures and a summary in words.

evidence    results of the tasks, sorted by data set, identifier and recipe
scoreboard  the numbers of the summary tables; parameters: those of the fitted models
pairs       differences between models against the scatter over the folds
tables      tables as Markdown, LaTeX and for the terminal
findings    sentences that the numbers support; summary: the page that holds all of it
boxplots, horizons, tradeoff, curves, motion: one kind of picture each; style: common looks
refined     parameters with intervals, as shooting finds them
write       all files of a report; terminal: the summary table printed
"""

from frictionid.report.refined import show_refined
from frictionid.report.terminal import show, show_scores
from frictionid.report.write import build

__all__ = ["build", "show", "show_refined", "show_scores"]
