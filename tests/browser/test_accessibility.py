"""What axe-core finds at fault in the pages, wide and narrow, light and dark."""

from importlib.resources import files

import pytest

from frf_ipz.report.page import write_report
from frf_ipz.runs.results import Results
from opened_page import open_page
from served_page import Page
from synthetic_run import synthetic_folder

pytestmark = [pytest.mark.browser, pytest.mark.slow]
PATIENCE_S = 120

RUN = """
const done = arguments[arguments.length - 1];
document.querySelectorAll('details').forEach((list) => { list.open = true; });
const whatFails = {resultTypes: ['violations']};  // what passes is counted, and not listed: half of the time
axe.run(document, whatFails).then(
  (r) => done(r.violations.map((v) => [v.id, v.nodes.map((n) => n.html.slice(0, 120))])));
"""


@pytest.fixture(params=[(1280, "light"), (1280, "dark"), (390, "light"), (390, "dark")], ids=lambda p: f"{p[0]}-{p[1]}")
def screen(browser, request):
    """A browser as wide as that, of somebody who prefers that theme."""
    width, theme = request.param
    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False},
    )
    browser.execute_cdp_cmd(
        "Emulation.setEmulatedMedia", {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    )
    yield browser
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


def faults(browser):
    browser.execute_script((files("axe_core_python") / "axe.min.js").read_text(encoding="utf-8"))
    browser.set_script_timeout(PATIENCE_S)
    return browser.execute_async_script(RUN)


def test_a_report_has_no_fault(screen, tmp_path):
    path = tmp_path / "report.html"
    write_report(Results(synthetic_folder(diagnosed=True)), path)
    open_page(screen, path)
    assert faults(screen) == []


def test_a_page_that_is_shown_has_no_fault(screen, address):
    Page(screen, address)
    assert faults(screen) == []


def test_a_fault_is_found(browser):
    browser.get("data:text/html,<html lang=en><title>A page</title><main><h1>A page</h1><img src=x></main>")
    assert [name for name, _ in faults(browser)] == ["image-alt"]
