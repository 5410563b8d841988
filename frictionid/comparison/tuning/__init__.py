"""Tuning: settings of identifiers, searched without the recordings that judge them.

nested_folds   the recordings that tuning may see, and those held out from it
trial          what is tuned: an identifier by a recipe on one data set; its trials
studies        the searches, in a journal on disk that an interrupted one is resumed from
tuned_suite    the suite with the settings that were chosen
"""

from frictionid.comparison.tuning.studies import Found, StudySpec, study_specs, tune
from frictionid.comparison.tuning.trial import TuningTask, tuning_tasks
from frictionid.comparison.tuning.tuned_suite import chosen_suite

__all__ = [
    "Found",
    "StudySpec",
    "TuningTask",
    "chosen_suite",
    "study_specs",
    "tune",
    "tuning_tasks",
]
