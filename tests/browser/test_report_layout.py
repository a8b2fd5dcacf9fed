"""The layout of the page in a real browser: what is chosen, labels of axes, narrow screens, paper, contrasts."""

import pytest

from frf_ipz.report.page import write_report
from frf_ipz.runs.results import Results
from opened_page import errors, open_once, open_page, wait_for
from synthetic_run import synthetic_folder

pytestmark = pytest.mark.browser

PAPER_PX = (688, 986)  # A4 without its margins at 96 pixels an inch
LEAST_CONTRAST = 4.5  # of text, success criterion 1.4.3 of WCAG 2.2
PARTICULARS = {"operator": "A. Meier", "date": "2026-11-27", "customer": "Example Machines Ltd"}
FRAME = """
const shown = document.documentElement.clientWidth;
return [...document.querySelectorAll('body *')].filter((e) => {
  const box = e.getBoundingClientRect();
  return box.width > 0 && box.right > shown + 1 && !e.closest('.scroll, pre, .main-svg, .skip');
}).map((e) => e.outerHTML.slice(0, 80));
"""
OUTSIDE = """
const around = (element) => element.getBoundingClientRect();
return [...document.querySelectorAll('.plot .main-svg text')].filter((text) => {
  const [words, picture] = [around(text), around(text.closest('.plot'))];
  const beyond = Math.max(picture.left - words.left, words.right - picture.right, words.bottom - picture.bottom);
  return words.width > 0 && beyond > 1;
}).map((text) => text.closest('figure').id + ': ' + text.textContent);
"""
CONTRASTS = """
const numbers = (text) => text.match(/[\\d.]+/g).slice(0, 3).map(Number);
const light = (rgb) => {
  const [r, g, b] = rgb.map((c) => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
};
const behind = (element) => {
  for (let e = element; e; e = e.parentElement) {
    const colour = getComputedStyle(e).backgroundColor;
    if (!/, 0\\)$|transparent|color\\(/.test(colour)) return colour;
  }
  return 'rgb(255, 255, 255)';
};
const contrast = (ink, paper) => {
  const [a, b] = [light(numbers(ink)), light(numbers(paper))].sort((x, y) => y - x);
  return (a + 0.05) / (b + 0.05);
};
const paper = getComputedStyle(document.body).backgroundColor;
const drawn = [...document.querySelectorAll('.main-svg text')]
  .filter((t) => t.textContent && !t.closest('.bars, .hm, .modebar, .heatmap-label, .heatmaplayer'))
  .map((t) => ['drawn ' + t.textContent, contrast(getComputedStyle(t).fill, paper)]);
const tags = "p, td, th, dt, dd, a, h1, h2, h3, li, button, summary, caption, select, footer, figcaption";
const written = [...document.querySelectorAll(tags)]
  .filter((e) => e.offsetParent)
  .map((e) => [e.tagName + " " + e.textContent.slice(0, 30), contrast(getComputedStyle(e).color, behind(e))]);
return [...drawn, ...written];
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("layout") / "report.html"
    folder = synthetic_folder(diagnosed=True)
    folder.manifest["test"] = PARTICULARS
    write_report(Results(folder), path)
    return path


@pytest.fixture
def screen(browser):
    """The browser without a page: of another width or theme for one test."""
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})


@pytest.fixture
def page(screen, written):
    return open_once(screen, written)


def resize(page, width, height=900):
    page.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )


def prefer(page, theme):
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]})


def test_the_frf_at_the_point_of_interest_is_the_first_picture(page):
    assert page.find_element("css selector", "figure").get_attribute("id") == "prediction-0"
    names = page.execute_script("return document.querySelector('#prediction-0 .plot').data.map((t) => t.name)")
    assert {"90 % band", "measured, kept aside", "nominal model", "updated model"} == set(names)


def test_the_frf_that_is_chosen_is_laid_over_its_models(page):
    shown = "const p = document.querySelector('#overlay .plot'); return [p.data.map((t) => t.name), [...p.data[0].y]]"
    names, before = page.execute_script(shown)
    assert names == ["measured", "nominal model", "updated model"] * 2
    first, second = page.find_elements("css selector", "#overlay option")
    second.click()
    title = page.find_element("css selector", "#overlay figcaption").text
    assert title.startswith(second.text)
    assert first.text not in title
    assert second.text in page.find_element("css selector", "#overlay .plot").get_attribute("aria-label")
    names, after = page.execute_script(shown)
    assert before != after
    page.find_element("id", "theme").click()  # draws all anew
    assert page.execute_script(shown)[1] == after
    page.find_element("id", "theme").click()
    first.click()
    assert page.execute_script(shown)[1] == before
    assert errors(page) == []


@pytest.mark.parametrize("zoom", [None, (12.0, 900.0), (100.0, 160.0)])
def test_ticks_of_frequency_axes_are_whole_numbers_and_few(page, zoom):
    if zoom is not None:
        ends = ", ".join(f"'xaxis.range[{k}]': Math.log10({end})" for k, end in enumerate(zoom))
        page.execute_script(f"Plotly.relayout(document.querySelector('#frf .plot'), {{{ends}}})")
    for figure in ("frf", "prediction-0", "overlay"):
        ticks = page.execute_script(
            f"return [...document.querySelectorAll('#{figure} .xtick text')].map((t) => t.textContent)"
        )
        numbers = [float(text) for text in ticks]
        assert 2 <= len(numbers) <= 14  # of five digits each at 1180 px
        assert numbers == sorted(set(numbers))
        if zoom == (12.0, 900.0):
            assert numbers == [20, 50, 100, 200, 500]
    page.find_element("css selector", "#frf .plot").send_keys("0")


@pytest.mark.usefixtures("left_changed")
@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_nothing_is_wider_than_a_narrow_screen(screen, written, theme):
    resize(screen, 390)
    prefer(screen, theme)
    page = open_page(screen, written)
    assert page.execute_script("return document.documentElement.scrollWidth") <= 390
    assert page.execute_script(FRAME) == []
    assert page.execute_script(OUTSIDE) == []


@pytest.mark.usefixtures("left_changed")
@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
def test_all_that_is_written_stands_out_from_what_is_behind_it(screen, written, theme):
    prefer(screen, theme)
    page = open_page(screen, written)
    contrasts = page.execute_script(CONTRASTS)
    assert len(contrasts) > 300
    assert [(text, ratio) for text, ratio in contrasts if ratio < LEAST_CONTRAST] == []


def test_printed_pages_bear_the_name_of_the_run_and_their_number(page):
    rules = page.execute_script(
        "return [...document.styleSheets[0].cssRules].filter((r) => r instanceof CSSPageRule).map((r) => r.cssText)"
    )
    margins = next(rule for rule in rules if "@top-left" in rule)
    assert '"synthetic <beam>"' in margins
    assert "counter(page)" in margins
    assert "counter(pages)" in margins


@pytest.mark.usefixtures("left_changed")
def test_the_summary_fills_the_first_two_printed_pages(page):
    resize(page, *PAPER_PX)
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    start, middle, next_page, end = page.execute_script(
        "const box = (query) => document.querySelector(query).getBoundingClientRect();"
        "return [box('.head').top, box('#overview .cards').bottom, box('#overview .cards + *').top,"
        " box('#overview').bottom]"
    )
    breaks = page.execute_script(
        "return ['#overview', '#overview .cards'].map((q) => getComputedStyle(document.querySelector(q)).breakAfter)"
    )
    cuts = page.execute_script(
        "return [...document.querySelectorAll('figure, .plot, .card')].map((e) => getComputedStyle(e).breakInside)"
    )
    page.execute_script("window.dispatchEvent(new Event('afterprint'))")
    assert middle - start <= PAPER_PX[1]
    assert end - next_page <= PAPER_PX[1]
    assert breaks == ["page", "page"]
    assert set(cuts) == {"avoid"}


@pytest.mark.usefixtures("left_changed")
def test_a_browser_that_cannot_unpack_the_library_says_so_and_shows_the_tables(browser, written):
    old = browser.execute_cdp_cmd(
        "Page.addScriptToEvaluateOnNewDocument", {"source": "delete window.DecompressionStream;"}
    )
    try:
        browser.get(written.as_uri())
        wait_for(browser, "return document.querySelector('.plot').textContent.includes('too old to draw')")
        assert browser.find_element("css selector", "#state-space table").is_displayed()
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", {"identifier": old["identifier"]})


@pytest.mark.usefixtures("left_changed")
def test_the_structure_moves_turns_and_rests(page):
    image = "return document.querySelector('#shape canvas').toDataURL()"
    page.execute_script("document.querySelector('#shape').scrollIntoView()")
    wait_for(page, "return document.querySelector('#play').textContent === 'Pause'")
    page.execute_script("document.querySelector('#play').click()")
    assert page.execute_script("return document.querySelector('#shape figcaption').textContent").startswith("Mode 1")
    at_rest = page.execute_script(image)
    turn = "document.querySelector('#shape canvas').dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight'}))"
    page.execute_script(turn)
    turned = page.execute_script(image)
    assert turned != at_rest
    page.execute_script("document.querySelector('#shape [data-view=front]').click()")
    assert page.execute_script(image) == at_rest  # a beam is seen from the front at first
    page.execute_script(
        "const modes = document.querySelector('#shape [name=mode]'); modes.value = '1';"
        "modes.dispatchEvent(new Event('change', {bubbles: true}))"
    )
    assert page.execute_script("return document.querySelector('#shape figcaption').textContent").startswith("Mode 2")
    assert page.execute_script(image) != at_rest
    assert not errors(page)
