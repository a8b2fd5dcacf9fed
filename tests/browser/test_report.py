"""The page in a real browser: every picture draws, nothing is an error, hover, keys, linked axes, themes, print."""

import base64

import numpy as np
import pytest

from frf_ipz.report.page import write_report
from frf_ipz.runs.results import Results
from hostile_run import HOSTILE, hostile_folder
from opened_page import errors, open_once, open_page, wait_for
from synthetic_run import Folder, many_frfs, synthetic_folder

pytestmark = pytest.mark.browser

ARROW_RIGHT, TAB, ENTER, SPACE = "\ue014", "\ue004", "\ue007", " "  # as WebDriver writes them
LONG = f"<details><table>{'<tr><td>1</td></tr>' * 50}</table></details>"
ROWS_AND_STATE = (
    "return [...document.querySelectorAll('main details')].map((d) => [d.querySelectorAll('tr').length, d.open])"
)
DRAWN = ".main-svg .trace, .main-svg .bars, .main-svg .hm, canvas"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(Results(synthetic_folder(diagnosed=True)), path)
    return path


@pytest.fixture
def page(browser, written):
    return open_once(browser, written)


def axis_range(page, name, axis="xaxis"):
    return page.execute_script(f"return document.querySelector('#{name} .plot')._fullLayout.{axis}.range")


def visible_traces(page, name):
    script = f"return document.querySelector('#{name} .plot').data.filter((t) => t.visible !== false).length"
    return page.execute_script(script)


def drawn_traces(page, name):
    script = f"return document.querySelector('#{name} .plot').data.filter((t) => (t.visible ?? true) === true).length"
    return page.execute_script(script)


def test_every_picture_draws_and_nothing_is_an_error(page):
    empty = page.execute_script(
        "return [...document.querySelectorAll('figure')].filter((f) => !f.querySelector(arguments[0]))"
        ".map((f) => f.id)",
        DRAWN,
    )
    assert empty == []
    assert errors(page) == []


def test_hovering_over_a_pole_shows_its_frequency_and_damping(page):
    fit = synthetic_folder().results["fit"]
    plot = page.find_element("css selector", "#pole-zero-map .plot")
    page.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    x, y = page.execute_script(
        "const l = arguments[0]._fullLayout, box = arguments[0].getBoundingClientRect();"
        "const t = arguments[0].data.find((d) => d.name === 'poles' && d.mode === 'markers');"
        "return [box.x + l.xaxis._offset + l.xaxis.d2p(t.x[2]), box.y + l.yaxis._offset + l.yaxis.d2p(t.y[2])];",
        plot,
    )
    page.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": "mouseMoved", "x": x, "y": y})
    wait_for(page, "return document.querySelector('#pole-zero-map .hovertext') !== null")
    text = page.find_element("css selector", "#pole-zero-map .hoverlayer").text
    assert f"{fit.model.natural_frequency_hz[2]:.7g}"[:6] in text
    assert f"{100 * fit.model.damping_ratio[2]:.5f}"[:5] in text
    assert "pole 3" in text


@pytest.mark.usefixtures("left_changed")
def test_zooming_one_frequency_axis_zooms_all(page):
    zoom = "{'xaxis.range[0]': Math.log10(100), 'xaxis.range[1]': Math.log10(300)}"
    page.execute_script(f"Plotly.relayout(document.querySelector('#frf .plot'), {zoom})")
    for name in ("stabilisation", "fit-picture", "pairs", "prediction-0", "pole-zero-map"):
        np.testing.assert_allclose(axis_range(page, name), np.log10([100, 300]), rtol=1e-9, atol=0)


def test_a_linear_frequency_axis_shows_the_same_range(page):
    before = axis_range(page, "frf")
    page.find_element("id", "scale").click()
    np.testing.assert_allclose(axis_range(page, "frf"), 10 ** np.array(before), rtol=1e-6, atol=0)
    page.find_element("id", "scale").click()
    np.testing.assert_allclose(axis_range(page, "frf"), before, rtol=1e-6, atol=0)


def test_an_frf_that_is_switched_off_leaves_all_pictures(page):
    before = {name: visible_traces(page, name) for name in ("frf", "fit-picture", "pole-zero-map")}
    page.find_element("css selector", ".chooser summary").click()
    page.find_element("css selector", ".chooser input[value='1']").click()
    for name, count in before.items():
        assert visible_traces(page, name) < count
    assert page.find_element("id", "shown").text == "1 of 2"
    page.find_element("css selector", ".chooser button[data-all='1']").click()
    assert {name: visible_traces(page, name) for name in before} == before
    page.find_element("css selector", ".chooser summary").click()


def test_keys_zoom_and_move_and_go_back(page):
    plot = page.find_element("css selector", "#frf .plot")
    whole = axis_range(page, "frf")
    plot.send_keys("+")
    zoomed = axis_range(page, "frf")
    assert whole[0] < zoomed[0] < zoomed[1] < whole[1]
    plot.send_keys(ARROW_RIGHT)
    assert axis_range(page, "frf")[0] > zoomed[0]
    plot.send_keys("0")
    np.testing.assert_allclose(axis_range(page, "frf"), whole, rtol=1e-9, atol=0)


def test_the_legend_is_worked_with_the_keyboard_and_shows_where_one_is(page):
    count = visible_traces(page, "frf")
    entries = "#frf .legend .traces"
    page.execute_script("document.querySelector('#frf .plot').focus()")
    for _ in range(40):  # the buttons of the picture come before
        page.switch_to.active_element.send_keys(TAB)
        if page.execute_script("return document.activeElement.matches(arguments[0])", entries):
            break
    entry = page.switch_to.active_element
    label = entry.get_attribute("aria-label")
    assert (entry.get_attribute("role"), entry.get_attribute("aria-pressed")) == ("button", "true")
    assert label
    assert page.execute_script("return getComputedStyle(document.activeElement).outlineStyle") == "solid"
    for key, pressed in ((ENTER, "false"), (SPACE, "true")):
        page.switch_to.active_element.send_keys(key)
        now = f"document.activeElement.getAttribute('aria-pressed') === '{pressed}'"
        wait_for(page, f"return {now} && document.activeElement.matches('{entries}')")
        assert page.switch_to.active_element.get_attribute("aria-label") == label
        assert (drawn_traces(page, "frf") < count) == (pressed == "false")


@pytest.mark.usefixtures("left_changed")
def test_what_is_switched_off_in_a_legend_stays_off_when_the_page_is_drawn_anew(page):
    page.execute_script("Plotly.restyle(document.querySelector('#frf .plot'), {visible: 'legendonly'}, [0])")
    page.find_element("id", "theme").click()
    assert page.execute_script("return document.querySelector('#frf .plot').data[0].visible") == "legendonly"
    page.find_element("id", "theme").click()


def test_the_dark_theme_changes_page_and_pictures(page):
    count = page.execute_script("return document.documentElement.dataset.theme")
    paper = "return document.querySelector('#frf .plot')._fullLayout.paper_bgcolor"
    before = page.execute_script(paper)
    page.find_element("id", "theme").click()
    assert page.execute_script("return document.documentElement.dataset.theme") != count
    assert page.execute_script(paper) != before
    page.find_element("id", "theme").click()
    assert page.execute_script(paper) == before


def test_printing_gives_pages_with_every_picture(page):
    page.set_window_size(1280, 900)
    answer = page.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})
    pdf = base64.b64decode(answer["data"])
    assert pdf.startswith(b"%PDF")
    assert pdf.count(b"/Type /Page\n") + pdf.count(b"/Type /Page /") >= 5
    assert errors(page) == []


@pytest.mark.usefixtures("left_changed")
def test_short_tables_are_printed_and_long_ones_stay_with_the_screen(page):
    page.execute_script("document.querySelector('main details').insertAdjacentHTML('afterend', arguments[0])", LONG)
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    printed = page.execute_script(ROWS_AND_STATE)
    page.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert [50, False] in printed
    short = [is_open for count, is_open in printed if count < 10]
    assert short
    assert all(short)
    assert not any(is_open for _, is_open in page.execute_script(ROWS_AND_STATE))


def test_no_picture_is_wider_than_the_paper_when_printed(page):
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    widths = page.execute_script("return [...document.querySelectorAll('.main-svg')].map((s) => s.width.baseVal.value)")
    page.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert 0 < max(widths) <= 700


@pytest.mark.slow
def test_a_hundred_frfs_of_fifty_thousand_lines_draw(browser, tmp_path):
    path = tmp_path / "big.html"
    write_report(
        Results(Folder(results={"ingest": many_frfs(100, 50_000)}, manifest={"stages": {"ingest": {}}}, stale=())), path
    )
    page = open_page(browser, path)
    assert page.find_element("id", "shown").text == "6 of 100"
    assert errors(page) == []


def test_hostile_names_are_drawn_as_text(browser, tmp_path):
    path = tmp_path / "hostile.html"
    write_report(Results(hostile_folder()), path)
    page = open_page(browser, path)
    assert page.execute_script("return window.hacked") is None
    assert page.execute_script("return document.querySelectorAll('img').length") == 0
    assert HOSTILE in page.find_element("css selector", "h1").text
    for picture in ("records", "law-response"):
        drawn = page.execute_script(f"return document.querySelector('#{picture} .main-svg').parentNode.textContent")
        assert HOSTILE in drawn, picture
    entry = page.execute_script("return document.querySelector('#records .legend .traces').getAttribute('aria-label')")
    assert entry.endswith(HOSTILE)
    assert errors(page) == []
