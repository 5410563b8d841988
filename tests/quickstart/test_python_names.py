"""What commands do is there in Python under `import frictionid`."""

import frictionid
from frictionid.comparison.cross_validate import compare
from frictionid.comparison.fit_model import fit_model
from frictionid.evaluation.predicted_motion import predicted_motion
from frictionid.quickstart.quick import quick


def test_the_functions_behind_the_commands_are_at_the_top():
    assert frictionid.quick is quick and frictionid.fit_model is fit_model
    assert frictionid.compare is compare and frictionid.predicted_motion is predicted_motion
    assert {"quick", "compare", "fit_model", "predicted_motion"} <= set(dir(frictionid))
