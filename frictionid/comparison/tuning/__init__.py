"""Tuning: settings of identifiers, searched without the recordings that score them.

tuning_task    what is tuned: an identifier by a recipe on one data set; what it may see; its score
journal        Optuna's studies in a journal on disk, which an interrupted search is resumed from
studies        the searches, and the suite with the settings that were chosen
"""

from .studies import Study, study_specs, tune
from .tuning_task import TuningTask, tuning_tasks
