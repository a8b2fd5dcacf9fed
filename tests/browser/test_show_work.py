"""What the page to work on offers beside the choices themselves, in a real browser.

Undo and redo, the curve before a change, edges of the band, a search for causes that is started and cancelled,
downloads.
"""

import json
import time

import pytest

from demo_case import copy_demo
from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.runs.results import open_results
from hostile_run import HOSTILE
from served_page import Page, served

pytestmark = [pytest.mark.browser, pytest.mark.slow]
NEAR = 0.02  # relative: what a pixel is on the axis

LEGEND = """
const plot = document.querySelector('[id^=prediction-] .plot');
return plot.data.filter((trace) => trace.name === 'before the last change').length;
"""
EDGES = """
return [...document.querySelectorAll('#frf .edge')].map((edge) => {
  const box = edge.getBoundingClientRect();
  return [box.left + box.width / 2, box.top + box.height / 2, Number(edge.getAttribute('aria-valuenow'))];
});
"""
AT_HZ = """
const plot = document.querySelector('#frf .plot'), { xaxis } = plot._fullLayout;
return plot.getBoundingClientRect().left + xaxis._offset + xaxis.d2p(arguments[0]);
"""
SAVED = """
const [selector, done] = arguments;
fetch(document.querySelector(selector).href).then(async (answer) => done([
  answer.status, answer.headers.get('content-type'), answer.headers.get('content-disposition'),
  [...new Uint8Array(await answer.arrayBuffer()).slice(0, 300)].map((byte) => String.fromCharCode(byte)).join(''),
]));
"""


@pytest.fixture
def folder(demo, tmp_path):
    return copy_demo(demo, tmp_path)


@pytest.fixture
def page(browser, folder):
    with served(folder / "out") as address:
        page = Page(browser, address)
        yield page
        assert not page.errors()


def band(folder):
    return read_pipeline(folder / "pipeline.toml").file.fit.band_hz


def command(page, name):
    before = page.stamp()
    page.click(f"[data-command={name}]")
    page.wait_for_results(before)


def is_enabled(page, name):
    return page.find(f"[data-command={name}]").is_enabled()


def test_a_change_is_undone_and_made_again_and_the_curve_before_it_is_seen(page, folder):
    text = (folder / "pipeline.toml").read_bytes()
    assert (is_enabled(page, "undo"), is_enabled(page, "redo")) == (False, False)
    assert page.run(LEGEND) == 0
    page.write("#band-form", low_hz="12", high_hz="400")
    before = page.stamp()
    page.click("#band-form [value=band]")
    page.wait_for_results(before)
    changed = (folder / "pipeline.toml").read_bytes()
    assert band(folder) == (12.0, 400.0)
    assert page.run(LEGEND) == 2  # magnitude and phase
    assert (is_enabled(page, "undo"), is_enabled(page, "redo")) == (True, False)
    command(page, "undo")
    assert (folder / "pipeline.toml").read_bytes() == text
    assert page.run(LEGEND) == 2
    assert (is_enabled(page, "undo"), is_enabled(page, "redo")) == (False, True)
    command(page, "redo")
    assert (folder / "pipeline.toml").read_bytes() == changed
    keys = pytest.importorskip("selenium.webdriver").Keys
    before = page.stamp()
    page.find("#band-form [name=low_hz]").send_keys(keys.CONTROL, "z")  # in a field it means the field
    page.run("document.activeElement.blur()")
    assert (folder / "pipeline.toml").read_bytes() == changed
    page.find("body").send_keys(keys.CONTROL, "z")
    page.wait_for_results(before)
    assert (folder / "pipeline.toml").read_bytes() == text


def test_an_edge_of_the_band_is_dragged_and_moved_by_keys(page, folder):
    page.show("#frf")
    page.wait_until(lambda: len(page.run(EDGES)) == 2)
    first = [edge[2] for edge in page.run(EDGES)]
    assert first == pytest.approx(open_results(folder / "out").fit.band_hz, rel=1e-6)
    x, y, _ = page.run(EDGES)[1]
    before = page.stamp()
    page.drag([(x, y), ((x + page.run(AT_HZ, 400.0)) / 2, y), (page.run(AT_HZ, 400.0), y)])
    page.wait_for_results(before)
    assert band(folder) == (pytest.approx(first[0], rel=1e-5), pytest.approx(400.0, rel=NEAR))
    page.wait_until(lambda: len(page.run(EDGES)) == 2)
    keys = pytest.importorskip("selenium.webdriver").Keys
    low, high = (edge[2] for edge in page.run(EDGES))
    page.show("#frf")
    edge = page.find("#frf .edge")
    edge.send_keys(keys.ARROW_RIGHT * 10)
    assert page.run(EDGES)[0][2] > low
    edge.send_keys(keys.ESCAPE)
    assert page.run(EDGES)[0][2] == low
    edge.send_keys(keys.ARROW_RIGHT * 10)
    moved, before = page.run(EDGES)[0][2], page.stamp()
    edge.send_keys(keys.ENTER)
    page.wait_for_results(before)
    assert band(folder) == (pytest.approx(moved, rel=1e-5), pytest.approx(high, rel=1e-5))


def test_an_edge_that_is_let_go_where_it_was_changes_nothing(page, folder):
    text = (folder / "pipeline.toml").read_bytes()
    page.show("#frf")
    page.wait_until(lambda: len(page.run(EDGES)) == 2)
    x, y, _ = page.run(EDGES)[0]
    page.click_at((x, y))
    time.sleep(0.5)
    assert (folder / "pipeline.toml").read_bytes() == text
    assert page.run("return document.documentElement.dataset.running") == "false"


def test_causes_are_looked_for_by_a_button_and_that_can_be_cancelled(page, folder):
    text, before = (folder / "pipeline.toml").read_bytes(), page.stamp()
    page.click("[data-command=diagnose]")
    page.wait_until(lambda: page.find("#doing").text.startswith("diagnose: "))
    page.click("#status [data-command=cancel]")
    page.wait_until(lambda: page.run("return document.documentElement.dataset.running") == "false")
    assert page.find("#problem").get_attribute("hidden")
    assert (page.stamp(), (folder / "pipeline.toml").read_bytes()) == (before, text)
    assert not (folder / "out" / "diagnosis.json").exists()


def test_files_and_pictures_are_downloaded(page):
    for selector, kind, start in (
        ("#downloads [download='poles.parquet']", "application/octet-stream", "PAR1"),
        ("#downloads [download='statespace.json']", "application/octet-stream", "{"),
        ("#downloads [download='prediction.svg']", "image/svg+xml", "<?xml"),
        ("#downloads [download='frfs.png']", "image/png", "\x89PNG"),
    ):
        status, media_type, disposition, content = page.browser.execute_async_script(SAVED, selector)
        assert (status, media_type) == (200, kind), selector
        assert disposition.startswith("attachment")
        assert content.startswith(start)
    missing = page.browser.execute_async_script(
        "fetch('picture/nothing.svg').then((answer) => arguments[0](answer.status))"
    )
    assert missing == 400
    page.browser.get_log("browser")  # the browser notes the answer 400


def test_hostile_names_in_all_of_it_are_text(browser, folder):
    """Names of the pipeline, of its files, and what a run says it has written."""
    text = (folder / "pipeline.toml").read_text(encoding="utf-8")
    named = text.replace('name = "cantilever"', f"name = {json.dumps(HOSTILE)}")
    (folder / "pipeline.toml").write_text(named, encoding="utf-8")
    for manifest in (folder / "out").rglob("run.json"):
        content = json.loads(manifest.read_text(encoding="utf-8"))
        manifest.write_text(json.dumps({**content, "name": HOSTILE}), encoding="utf-8")
    hostile = folder / HOSTILE.replace("/", "_")[:60]
    hostile.mkdir()
    (folder / "out").rename(hostile / "out")
    with served(hostile / "out") as address:
        page = Page(browser, address)
        browser.get_log("performance")
        page.wait_until(lambda: len(page.run(EDGES)) == 2)
        page.write("#band-form", low_hz="12", high_hz="400")
        before = page.stamp()
        page.click("#band-form [value=band]")
        page.wait_for_results(before)
        command(page, "undo")
        assert page.run("return window.hacked") is None
        assert page.run("return document.querySelectorAll('img').length") == 0
        events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
        asked = [
            event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"
        ]
        assert asked
        assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
        assert not page.errors()
    assert (folder / "pipeline.toml").read_text(encoding="utf-8") == named
