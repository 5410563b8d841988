"""Tuning: settings of identifiers, searched without the recordings that judge them.

parts     the recordings that tuning may see, and those held out from it
unit      what is tuned: an identifier by a recipe on one data set; its trials
studies   the searches, in a journal on disk that an interrupted one is resumed from
outcome   what was found, as tables and as a suite to run; picture: the score over the trials
"""

from frictionid.tune.outcome import chosen_suite, score_table, settings_tables, write_outcome
from frictionid.tune.studies import Found, Lane, lanes_of, tune
from frictionid.tune.unit import Unit, units_of

__all__ = [
    "Found",
    "Lane",
    "Unit",
    "chosen_suite",
    "lanes_of",
    "score_table",
    "settings_tables",
    "tune",
    "units_of",
    "write_outcome",
]
