"""Files of figures: the same content, whoever draws them."""

from frictionid.report.exhibits import Picture
from frictionid.report.figures.style import drawing, figure
from frictionid.report.write import figure_files


def pictures():
    with drawing():
        figures = [figure(0.5, 0.5) for _ in range(6)]
        for k, panel in enumerate(figures):
            panel.subplots().set_axis_off()
            panel.text(0.5, 0.5, str(k))
    return [Picture(f"number--{k}", panel, "") for k, panel in enumerate(figures)]


def test_figures_are_the_same_by_any_number_of_processes():
    alone, together = (figure_files(pictures(), jobs) for jobs in (1, 2))
    assert together == alone
    assert len({files["svg"] for files in alone.values()}) == 6
