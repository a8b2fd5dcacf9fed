"""The page in a real browser: what is clicked there ends up in pipeline.toml and in the results."""

import pyarrow.parquet as pq
import pytest

from frf_ipz.identification.options import PinnedPole
from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.pipeline.run import run_pipeline
from served_page import PLACE_OF_NODE, Page

pytestmark = pytest.mark.browser
REJECTED_HZ = 284.95  # the third mode of the demo
ADDED_HZ = 150.0  # between two modes
NEAR = 0.02  # relative: a pole within this of a rejected one is the rejected one

PLACE_OF_POLE = """
const plot = document.querySelector('#stabilisation .plot');
const trace = plot.data.find((one) => one.mode === 'markers' && one.name.includes(arguments[1]));
const k = [...trace.x].findIndex((x) => Math.abs(x / arguments[0] - 1) < 0.01);
const { xaxis, yaxis } = plot._fullLayout, box = plot.getBoundingClientRect();
return [box.left + xaxis._offset + xaxis.d2p(trace.x[k]), box.top + yaxis._offset + yaxis.d2p(trace.y[k])];
"""
PLACES_OF_BAND = """
const { xaxis, yaxis } = document.querySelector('#stabilisation .plot')._fullLayout;
const box = document.querySelector('#stabilisation .plot').getBoundingClientRect();
const x = arguments[0].map((hz) => box.left + xaxis._offset + xaxis.d2p(hz));
return [...x, box.top + yaxis._offset + yaxis._length / 2];
"""

ASKED = "return performance.getEntriesByType('resource').filter((one) => one.name.includes('/zoom?')).length"
THEME = "return document.documentElement.dataset.theme"


@pytest.fixture
def page(browser, address):
    page = Page(browser, address)
    yield page
    assert not page.errors()


def poles(folder):
    return pq.read_table(folder / "poles.parquet")["frequency_hz"].to_pylist()


def is_there(folder, hertz):
    return any(abs(pole / hertz - 1) < NEAR for pole in poles(folder))


def test_every_picture_draws(page):
    drawn = page.run(
        "return [...document.querySelectorAll('figure .plot')].map((plot) => !!plot.querySelector('.main-svg'))"
    )
    assert len(drawn) >= 10
    assert all(drawn)


@pytest.mark.slow
def test_a_pole_rejected_in_the_diagram_is_gone_and_stays_gone_on_the_command_line(page, demo, tmp_path):
    assert is_there(demo / "out", REJECTED_HZ)
    comment = (demo / "pipeline.toml").read_text(encoding="utf-8").splitlines()[0]
    page.show("#stabilisation")
    page.click_at(page.run(PLACE_OF_POLE, REJECTED_HZ, "shape"))
    page.wait_until(lambda: page.value("#pole-form", "hz"))
    assert float(page.value("#pole-form", "hz")) == pytest.approx(REJECTED_HZ, rel=NEAR)
    page.write("#pole-form", why="a cable that rings")
    before = page.stamp()
    page.click("#pole-form [value=reject]")
    page.wait_for_results(before)
    assert not is_there(demo / "out", REJECTED_HZ)
    assert "a cable that rings" in page.find("#choices").text
    (rejection,) = read_pipeline(demo / "pipeline.toml").file.fit.strike
    assert (rejection.hz, rejection.why) == (pytest.approx(REJECTED_HZ, rel=NEAR), "a cable that rings")
    assert (demo / "pipeline.toml").read_text(encoding="utf-8").splitlines()[0] == comment
    remaining = poles(demo / "out")
    assert poles(run_pipeline(demo / "pipeline.toml", demo / "out").path) == remaining
    assert poles(run_pipeline(demo / "pipeline.toml", tmp_path / "anew").path) == remaining
    page.browser.refresh()
    page.wait_until(page.is_drawn)
    before = page.stamp()
    page.click("#choices [aria-label*='a cable that rings']")
    page.wait_for_results(before)
    assert is_there(demo / "out", REJECTED_HZ)


@pytest.mark.slow
def test_a_pole_is_added_with_its_reason(page, demo):
    page.write("#pole-form", hz=f"{ADDED_HZ:g}", why="seen by eye")
    before = page.stamp()
    page.click("#pole-form [value=pin]")
    page.wait_for_results(before)
    assert read_pipeline(demo / "pipeline.toml").file.fit.pinned == (PinnedPole(hz=ADDED_HZ, why="seen by eye"),)
    assert "pinned at 150 Hz: seen by eye" in page.find("#choices").text
    (row,) = page.browser.find_elements("xpath", "//tr[td='seen by eye']")
    assert "pinned" in row.text
    before = page.stamp()
    page.click("#choices [aria-label*='seen by eye']")
    page.wait_for_results(before)
    assert read_pipeline(demo / "pipeline.toml").file.fit.pin_hz == ()


def test_every_mode_of_the_fit_has_a_handle_to_click(page, demo):
    page.show("#stabilisation")
    page.click_at(page.run(PLACE_OF_POLE, REJECTED_HZ, "handles"))
    page.wait_until(lambda: page.value("#pole-form", "hz"))
    assert min(abs(float(page.value("#pole-form", "hz")) / hertz - 1) for hertz in poles(demo / "out")) < 1e-5


@pytest.mark.slow
def test_a_range_that_is_dragged_over_is_left_out(page, demo):
    page.click("[data-drag=select]")
    page.show("#stabilisation")
    low, high, height = page.run(PLACES_OF_BAND, [40.0, 60.0])
    page.drag([(low, height), ((low + high) / 2, height + 5), (high, height + 10)])
    page.wait_until(lambda: page.value("#band-form", "high_hz"))
    before, theme = page.stamp(), page.run(THEME)
    page.click("#theme")
    page.click("#band-form [value=exclude]")
    page.wait_for_results(before)
    assert page.run(THEME) not in {theme, None}
    ((low_hz, high_hz),) = read_pipeline(demo / "pipeline.toml").file.fit.exclude_hz
    assert (low_hz, high_hz) == (pytest.approx(40.0, rel=0.02), pytest.approx(60.0, rel=0.02))
    assert "1 ranges left out" not in page.find("#stabilisation .note").text
    assert "1 range left out" in page.find("#stabilisation .note").text
    assert page.find("[data-drag=select]").get_attribute("aria-pressed") == "true"


@pytest.mark.slow
def test_zooming_in_brings_all_lines_of_the_frfs(page, demo):
    lines = pq.read_table(
        demo / "out" / "frf.parquet", filters=[("frequency_hz", ">", 299.9), ("frequency_hz", "<", 303.1)]
    )
    frequencies = sorted(set(lines["frequency_hz"].to_pylist()))
    curve = "document.querySelector('#frf .plot').data.find((one) => !one.fill)"
    inside = f"return [...{curve}.x].filter((x) => x > 299.9 && x < 303.1).length"
    page.show("#frf")
    page.run(
        "const plot = document.querySelector('#stabilisation .plot'), isLog = plot.layout.xaxis.type === 'log';"
        "const end = (hz) => (isLog ? Math.log10(hz) : hz);"
        "Plotly.relayout(plot, {'xaxis.range[0]': end(300), 'xaxis.range[1]': end(303)});"
    )
    page.wait_until(lambda: page.run("return !!document.querySelector('#frf .plot').dataset.sharp"))
    assert page.run(inside) == len(frequencies)
    page.click("#theme")
    page.wait_until(lambda: page.run(inside) == len(frequencies))
    assert page.run(ASKED) <= 3  # once for the view, once for the theme, and a linked axis may follow late


@pytest.mark.slow
def test_a_record_is_dropped(page, demo):
    page.click("#record-choices summary")
    before = page.stamp()
    page.run(
        "const list = document.querySelector('[data-record=\"hits/p69_02.csv\"]'); list.value = 'drop';"
        "list.dispatchEvent(new Event('change', {bubbles: true}));"
    )
    page.wait_for_results(before)
    records = pq.read_table(demo / "out" / "records.parquet").to_pandas().set_index("record")
    assert not records.loc["hits/p69_02.csv", "used"]
    assert page.find("[data-record='hits/p69_02.csv']").get_attribute("value") == "drop"


@pytest.mark.slow
def test_a_point_picked_on_the_drawing_is_predicted(page, demo):
    page.show("#structure")
    page.click_at(page.run(PLACE_OF_NODE, "nodes", "node 33"))
    page.wait_until(lambda: page.value("#point-form", "dof") == "33:+z")
    before = page.stamp()
    page.click("#point-form [value=point]")
    page.wait_for_results(before)
    assert "33:+z" in pq.read_table(demo / "out" / "poi_frf.parquet")["output_dof"].to_pylist()


@pytest.mark.slow
def test_nodes_picked_on_the_drawing_are_what_the_model_is_reduced_to(page, demo):
    before = page.value("#reduce-form", "dofs").split()
    page.show("#structure")
    page.click_at(page.run(PLACE_OF_NODE, "retained in the reduction", before[-1]))
    page.wait_until(lambda: page.value("#point-form", "dof").replace("+", "") == before[-1])
    page.click("#toggle-dof")
    page.write("#point-form", dof="25:+z")
    page.click("#toggle-dof")
    selected = [*before[:-1], "25:z"]
    assert page.value("#reduce-form", "dofs").split() == selected
    stamp = page.stamp()
    page.click("#reduce-form [value=retain]")
    page.wait_for_results(stamp)
    assert read_pipeline(demo / "pipeline.toml").file.reduce.dofs == tuple(selected)
    run = run_pipeline(demo / "pipeline.toml", demo / "out")
    assert [dof.name for dof in run.reduced_model.dofs] == selected
    assert "reduced to" in page.find("#choices").text


@pytest.mark.slow
def test_what_the_run_refuses_is_said_and_taken_back(page, demo):
    text = (demo / "pipeline.toml").read_bytes()
    page.write("#point-form", dof="4711:+z")
    page.click("#point-form [value=point]")
    page.wait_until(lambda: "no node 4711" in page.find("#problem").text)
    assert "(the change was taken back)" in page.find("#problem").text
    assert (demo / "pipeline.toml").read_bytes() == text


@pytest.mark.slow
def test_a_rejection_without_a_reason_is_refused(page, demo):
    text = (demo / "pipeline.toml").read_bytes()
    page.write("#pole-form", hz="100")
    page.click("#pole-form [value=reject]")
    page.wait_until(lambda: "say why" in page.find("#problem").text)
    assert (demo / "pipeline.toml").read_bytes() == text
    page.browser.get_log("browser")  # the browser notes the answer 400


def test_the_structure_moves_and_rests(page):
    page.show("#shape")
    pose = "return document.querySelector('#shape canvas').toDataURL()"
    page.wait_until(lambda: "Mode 1" in page.find("#shape figcaption").text)
    first = page.run(pose)
    page.wait_until(lambda: page.run(pose) != first)
    page.click("#play")
    page.run(
        "const slider = document.querySelector('#phase'); slider.value = 0; slider.dispatchEvent(new Event('input'))"
    )
    at_rest = page.run(pose)
    page.run(
        "const slider = document.querySelector('#phase'); slider.value = 90; slider.dispatchEvent(new Event('input'))"
    )
    assert page.run(pose) != at_rest
    page.run(
        "const modes = document.querySelector('#shape-form').elements.mode; modes.value = '';"
        "modes.dispatchEvent(new Event('change', {bubbles: true}))"
    )
    page.wait_until(lambda: "for 1 N at" in page.find("#shape figcaption").text)
    assert page.find("#operating").is_displayed()


def test_nothing_but_the_run_is_served(page, demo):
    (demo / "secret.txt").write_text("secret", encoding="utf-8")
    (demo / "out" / "link.txt").symlink_to(demo / "secret.txt")
    addresses = [
        "poles.parquet",
        "..%2fsecret.txt",
        "%2e%2e%2fpipeline.toml",
        "link.txt",
        "/etc/passwd",
        "secret.txt",
    ]
    files = page.run("return document.querySelector('footer a').href").removesuffix("report.html")
    answers = page.browser.execute_async_script(
        "Promise.all(arguments[0].map((one) => fetch(one).then((answer) => answer.status))).then(arguments[1])",
        [files + address for address in addresses],
    )
    assert answers == [200, 404, 404, 404, 404, 404]
    page.browser.get_log("browser")  # the browser notes each answer 404


def test_it_can_be_worked_with_the_keyboard(page):
    keys = pytest.importorskip("selenium.webdriver").Keys
    page.run("document.querySelector('#modes [data-fill]').focus()")
    page.browser.switch_to.active_element.send_keys(keys.ENTER)
    assert float(page.value("#pole-form", "hz")) == pytest.approx(16.25, rel=0.01)
    assert page.browser.switch_to.active_element.get_attribute("name") == "why"
