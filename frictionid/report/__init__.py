"""What a person reads of a comparison: tables, pictures and a summary in words.

evidence    results of the tasks, sorted by data set, identifier and recipe
scoreboard  the numbers of the summary tables; parameters: those of the fitted models
pairs       differences between models against the scatter over the folds
tables      tables as Markdown, LaTeX and for the terminal
findings    sentences that the numbers support; summary: the page that holds all of it
boxplots, horizons, tradeoff, curves, motion: one kind of picture each; style: common looks
question    whether hybrids beat physics alone and black boxes; learned: which of them do
refined     what shooting found; intervals: its tables; remarks: its sentences; correlation, bands:
            its pictures; found: all of it for the page
ensembles   members of ensembles about their mean: a picture, and what captions say of the spread
loops       friction along sinusoids: pictures, table, sentence; speeds: which occurred; learning:
            losses over epochs
write       all files of a report; terminal: what is printed of it
"""

from frictionid.report.terminal import show, show_refined, show_scores
from frictionid.report.write import build

__all__ = ["build", "show", "show_refined", "show_scores"]
