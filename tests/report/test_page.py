"""The page index.html: whole in one file, its verdict first, and alive in a browser."""

import json
import re
import shutil
from html import unescape

import numpy as np
import pytest
from fixtures import result_folders as made
from fixtures.shared import shared

from frictionid.comparison.results import load_results
from frictionid.report.charts import motion_chart, side_view
from frictionid.report.figures.style import Style
from frictionid.report.model_tables import parameter_rows
from frictionid.report.sections import sections_of
from frictionid.report.verdict import verdict_of

HOSTILE = "</script><img src=x onerror=alert(1)>"
WIDTHS = (390, 1400)


def comparison(folder):
    """A fitted law with its own example motions, no friction, the truth, and a hostile name."""
    noise = [0.01, -0.01, 0.02, -0.02]
    own = made.task("stribeck", 0.4, 0.1, curve=0.05, noise=noise)
    own["motions"] += [made.example("made", place) for place in ("best", "median", "worst")]
    shot = made.shot(
        [
            made.parameter("friction", "coulomb", 0.1, 0.001, joint=0),
            made.parameter("friction", "viscous", 0.0, 0.1, joint=0, at_bound=True),
        ]
    )
    tasks = [
        made.task("none", 0.6, 0.9, curve=1.0, noise=noise, role="none"),
        own,
        made.task(HOSTILE, 0.5, 0.3, curve=0.2, noise=noise, refined=shot),
        made.task("truth", 0.35, 0.08, curve=0.0, noise=noise, role="truth"),
    ]
    return made.write(folder, tasks, title=f"Title {HOSTILE}")


@shared
def folder(tmp_path_factory):
    return made.undrawn(comparison(tmp_path_factory.mktemp("page")))


@shared
def page(folder):
    return (folder / "index.html").read_text()


def charts(page):
    """What Plotly draws, one document for each chart."""
    found = re.findall(r'<script type="application/json" id="[^"]*">(.*?)</script>', page, re.S)
    return [json.loads(text) for text in found]


def test_the_page_is_one_file_below_6_mb_and_asks_for_nothing_else(folder, page):
    assert len(page.encode()) < 6e6
    sources = re.findall(r'(?:src|href)="([^"]*)"', page)
    inside = [s for s in sources if not s.startswith(("data:", "#"))]
    assert inside and all((folder / s).exists() for s in map(unescape, inside))
    style = page.partition("</style>")[0]
    assert "url(" not in style and "@import" not in style


def test_the_verdict_comes_first_with_parameters_intervals_horizon_and_doubt(folder):
    (section,) = sections_of(load_results(folder))
    verdict = verdict_of(section)
    first = made.words(folder).partition("Data, and what they identify")[0]
    assert verdict.recommended == "stribeck"
    for text in (verdict.sentence, verdict.main_doubt, verdict.record_next):
        assert text in first
    assert "1 s ahead: 0.10 rad off in the median, 9 of 10 predictions within 0.20 rad" in first
    rows = parameter_rows(verdict.candidate("stribeck").model, section.fitted)
    assert [name for name, _, _ in rows] == ["coulomb", "viscous"]
    for name, unit, values in rows:
        assert f"{name} {unit}" in first
        assert all(value.text in first and value.interval in first for value in values)


def test_what_check_says_of_the_data_stands_on_the_page(tmp_path):
    finding = {"level": "doubtful", "text": "the torque acts late", "remedy": "free the delay"}
    about = made.about() | {"check": {"level": "doubtful", "findings": [finding], "next": []}}
    tasks = [made.task("stribeck", 0.4, 0.1)]
    words = made.words(made.undrawn(tmp_path, tasks, {"made": about}))
    assert "Checked before any fit: doubtful. the torque acts late; free the delay." in words


def test_intervals_of_folds_are_those_of_the_jackknife(folder):
    (section,) = sections_of(load_results(folder))
    model = next(m for m in section.models if m.label == "stribeck")
    folds = model.theta[:, 1, 0]
    half = 3.182 * np.sqrt(3 / 4 * np.sum((folds - folds.mean()) ** 2))  # t of 3 degrees of freedom
    low, high = parameter_rows(model, section.fitted)[0][2][1].interval.split(" to ")
    assert float(low) == pytest.approx(0.1 - half, abs=0.02 * half + 6e-4)
    assert float(high) == pytest.approx(0.1 + half, abs=0.02 * half + 6e-4)


def test_names_are_text_whatever_is_in_them(folder, page):
    assert "<img src=x" not in page and "</script><img" not in page
    assert f"Title {HOSTILE}" in made.words(folder)


def test_every_axis_has_its_unit_and_every_model_one_colour(page):
    colours = {}
    for chart in charts(page):
        for key, axis in chart["layout"].items():
            if key.startswith(("xaxis", "yaxis")) and axis.get("visible", True):
                assert re.search(r"\[.+\]$", axis["title"]["text"]), axis
        for trace in chart["data"]:
            if trace["name"] in ("stribeck", "predicted"):
                colours.setdefault(trace["line"]["color"], []).append(trace["name"])
    assert [set(names) for names in colours.values()] == [{"stribeck", "predicted"}]
    assert f'class="dot" style="background:{next(iter(colours))}"></span>stribeck' in page


def test_what_there_is_none_of_is_not_drawn(page, tmp_path):
    assert len(charts(page)) == 2 + 2 * 3  # two joints; lines and animation from three starts
    assert "<h2>Hysteresis" not in page and "<h2>Learning" not in page
    task = made.task("a", horizons=(), motions=False)
    bare = (made.undrawn(tmp_path, [task]) / "index.html").read_text()
    assert len(charts(bare)) == 2  # friction is there, motion is not
    assert "No verdict: the comparison predicts no motion." in made.words(tmp_path)


def test_parameters_at_a_bound_are_marked(page):
    cells = re.findall(r'<td class="[^"]*bound[^"]*">(.*?)</td>', page)
    assert cells and all("at its bound" in cell for cell in cells)


def test_an_arm_is_seen_from_the_side_in_which_it_is_widest():
    rng = np.random.default_rng(0)
    flat = np.cumsum(rng.standard_normal((5, 4, 2)), axis=1)  # in a vertical plane, turned about z
    turned = np.stack([0.6 * flat[..., 0], 0.8 * flat[..., 0], flat[..., 1]], axis=-1)
    (seen,) = side_view([turned])
    np.testing.assert_allclose(seen, flat, atol=1e-12)


def test_coupled_parts_have_friction_but_no_angle_to_draw():
    example = made.example("made", "median", joints=2)
    style = Style("#0072B2", "-")
    chart = motion_chart(example, made.description(3), style)
    assert [key for key in chart.layout if key.startswith("yaxis")] == ["yaxis1", "yaxis2"]
    still = {**example, "band": 0.0 * example["band"]}
    assert (
        "band" in chart.words
        and "band" not in motion_chart(still, made.description(2), style).words
    )


# --- In a browser ---------------------------------------------------------------------------------


@shared
def browser():
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="the test extra installs playwright"
    )
    place = shutil.which("chromium")
    if place is None:
        pytest.skip("no chromium to look at the page with")
    with sync_api.sync_playwright() as play:
        opened = play.chromium.launch(executable_path=place, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(scope="module", params=WIDTHS)
def seen(request, browser, folder):
    """The page as a browser shows it at one width, what it complains of, and what it asks for."""
    view = browser.new_page(viewport={"width": request.param, "height": 800})
    complaints, requests = [], []
    view.on("console", lambda message: complaints.append(message.text))
    view.on("pageerror", lambda error: complaints.append(str(error)))
    view.on("request", lambda asked: requests.append(asked.url))
    view.goto((folder / "index.html").as_uri())
    for chart in view.query_selector_all(".chart"):
        chart.scroll_into_view_if_needed()
    view.wait_for_function("!document.querySelector('.chart:not([data-drawn])')")
    yield view, complaints, requests
    view.close()


@pytest.mark.browser
def test_a_browser_complains_of_nothing_and_asks_for_nothing(seen, folder):
    _, complaints, requests = seen
    assert complaints == []
    outside = [url for url in requests if not url.startswith("data:")]
    assert outside == [(folder / "index.html").as_uri()]


@pytest.mark.browser
def test_the_page_is_as_wide_as_the_screen(seen):
    view = seen[0]
    assert view.evaluate("document.documentElement.scrollWidth <= innerWidth")
    # charts keep to their cards
    assert view.evaluate(
        "[...document.querySelectorAll('.chart')].every((c) => c.scrollWidth <= c.clientWidth + 1)"
    )


@pytest.mark.browser
def test_a_table_sorts_by_the_column_that_is_clicked(seen):
    view = seen[0]
    table = view.query_selector("table.sortable")
    heads = table.query_selector_all("thead button")
    column = next(i for i, h in enumerate(heads) if h.text_content().startswith("rollout 1 s"))

    def shown():
        cells = table.query_selector_all(f"tbody td:nth-child({column + 1})")
        return [float(cell.text_content().split()[0]) for cell in cells]

    heads[column].click()
    assert shown() == [0.08, 0.1, 0.3, 0.9]
    heads[column].click()
    assert shown() == [0.9, 0.3, 0.1, 0.08]


@pytest.mark.browser
def test_the_mechanism_moves_when_play_is_pressed(seen):
    view = seen[0]
    chart = view.query_selector(".chart:has(.updatemenu-button)")
    chart.scroll_into_view_if_needed()
    box = chart.bounding_box()
    for control in (".updatemenu-button", ".slider-rail-rect"):
        own = chart.query_selector(control).bounding_box()
        assert box["y"] <= own["y"] and own["y"] + own["height"] <= box["y"] + box["height"]
    lines = "[...c.querySelectorAll('.scatterlayer path.js-line')]"
    before = view.evaluate(f"(c) => {lines}.map((p) => p.getAttribute('d'))", chart)
    assert len(before) == 2  # measured and predicted
    chart.query_selector(".updatemenu-button").click()
    moved = f"([c, old]) => {lines}.every((p, i) => p.getAttribute('d') !== old[i])"
    view.wait_for_function(moved, arg=[chart, before], timeout=5000)


@pytest.mark.browser
def test_on_paper_figures_stand_for_charts(seen):
    view = seen[0]
    assert not any(shown.is_visible() for shown in view.query_selector_all(".still"))
    view.emulate_media(media="print")
    try:
        assert all(shown.is_visible() for shown in view.query_selector_all(".still"))
        assert not any(shown.is_visible() for shown in view.query_selector_all(".live"))
    finally:
        view.emulate_media(media="screen")
