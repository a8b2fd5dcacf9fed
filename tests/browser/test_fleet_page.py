"""The page of a fleet in a real browser: drawn, wide and narrow, light and dark, without an error."""

import pytest

from fleet_records import simulated_records
from frf_ipz.fleet.analysis import analyse_fleet
from frf_ipz.fleet.page import write_page
from opened_page import errors, open_page

pytestmark = pytest.mark.browser

OUTSIDE = """
const shown = document.documentElement.clientWidth;
return [...document.querySelectorAll('body *')].filter((e) => {
  const box = e.getBoundingClientRect();
  return box.width > 0 && box.right > shown + 1 && !e.closest('.scroll, pre, .main-svg, .skip');
}).map((e) => e.outerHTML.slice(0, 80));
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("fleet")
    write_page("line 3", analyse_fleet(simulated_records()), out)
    return out / "fleet.html"


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [1280, 390])
def test_every_picture_is_drawn_and_nothing_sticks_out(browser, written, width, theme):
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    wish = {"features": [{"name": "prefers-color-scheme", "value": theme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", wish)
    try:
        page = open_page(browser, written)
        empty = "return [...document.querySelectorAll('.plot')].filter((p) => !p.querySelector('.trace')).length"
        assert page.execute_script(empty) == 0
        assert page.execute_script("return document.documentElement.scrollWidth") <= width
        assert page.execute_script(OUTSIDE) == []
        assert page.title.startswith("line 3")
        assert errors(page) == []
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
