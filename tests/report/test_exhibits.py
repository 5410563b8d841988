"""Exhibits: captions say by what a law was fitted, figures are the same whoever draws them."""

import pytest
from fixtures import result_folders as made

from frictionid.report import write
from frictionid.report.exhibits import Picture
from frictionid.report.figures.style import drawing, figure


@pytest.mark.parametrize("scheme", ["shooting", "inverse dynamics"])
def test_captions_of_a_fit_name_its_method(scheme, tmp_path):
    own = made.task("law", curve=0.1, refined=made.shot())
    own["method"] = {"scheme": scheme, "corrects": []}
    folder = made.blank(tmp_path, [own])
    table = (folder / "tables/shooting--made--law.md").read_text()
    assert f"parameters of law by {scheme} (recipe" in table
    assert f"Friction by {scheme} on made with its 95 % bands" in made.words(folder)


def pictures():
    with drawing():
        figures = [figure(0.5, 0.5) for _ in range(6)]
        for k, panel in enumerate(figures):
            panel.subplots().set_axis_off()
            panel.text(0.5, 0.5, str(k))
    return [Picture(f"number--{k}", panel, "") for k, panel in enumerate(figures)]


def test_figures_are_the_same_by_any_number_of_processes():
    alone, together = (write.figure_files(pictures(), jobs) for jobs in (1, 2))
    assert together == alone
    assert len({files["svg"] for files in alone.values()}) == 6
