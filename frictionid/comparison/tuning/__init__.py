"""Tuning: settings of identifiers, searched without the recordings that score them.

nested_folds   the recordings that tuning may see, and those held out from it
tuning_task    what is tuned: an identifier by a recipe on one data set; the score of a trial
journal        Optuna's studies in a journal on disk, which an interrupted search is resumed from
studies        the searches
tuned_suite    the suite with the settings that were chosen
"""

from frictionid.comparison.tuning.studies import StudyResult, StudySpec, study_specs, tune
from frictionid.comparison.tuning.tuned_suite import chosen_suite
from frictionid.comparison.tuning.tuning_task import TuningTask, tuning_tasks
