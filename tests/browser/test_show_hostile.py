"""Results and campaigns of somebody who means harm, opened in the page to work on, in a real browser."""

import json
import shutil
import time
from urllib.parse import urlsplit

import pytest

from demo_case import copy_demo
from hostile_run import HOSTILE
from served_page import Page, served

pytestmark = pytest.mark.browser

SAID_BY_SCRIPT = "return document.title"
ATTACK = """
(async () => {
  document.title = 'hacked';
  const token = (document.referrer + location.href).match(/:[0-9]+[/]([^/]+)/)[1];
  const wish = JSON.stringify({kind: 'pin', hz: 123.0, why: 'hacked'});
  for (const address of ['change', '../../' + token + '/change', '/' + token + '/1/change']) {
    await fetch(address, {method: 'POST', headers: {'Content-Type': 'application/json'}, body: wish}).catch(() => 0);
    navigator.sendBeacon(address, wish);
  }
})();
"""
HOSTILE_PAGE = f"""<!DOCTYPE html><html><head><title>harmless</title><script src="own.js"></script>
<script>{ATTACK}</script></head><body onload="document.title = 'hacked'">
<img src=x onerror="document.title = 'hacked'"><iframe src="own.svg"></iframe></body></html>
"""
HOSTILE_DRAWING = f"""<svg xmlns="http://www.w3.org/2000/svg"><title>harmless</title><script>{ATTACK}</script>
<script href="own.js"/></svg>"""
POST = """
const [address, wish] = arguments;
return fetch(address, {method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(wish)})
  .then((answer) => answer.status, () => 'refused');
"""
REACH = """
const reached = [];
for (const name of ['localStorage', 'sessionStorage']) {
  try { window[name].setItem('a', 'b'); reached.push(name); } catch { }
}
try { document.cookie = 'a=b'; reached.push('cookie'); } catch { }
return [self.origin, document.referrer, window.opener === null, reached];
"""


@pytest.fixture
def folder(demo, tmp_path):
    """The demo with results that somebody else has put pages and scripts into."""
    copy_demo(demo, tmp_path)
    out = tmp_path / "out"
    (out / "report.html").write_text(HOSTILE_PAGE, encoding="utf-8")
    (out / "own.js").write_text(ATTACK, encoding="utf-8")
    for name in ("own.svg", "picture.png", "own.xhtml"):
        (out / name).write_text(HOSTILE_DRAWING, encoding="utf-8")
    return tmp_path


def requests(browser):
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]


def file_address(page):
    return page.run("return document.querySelector('footer a').href")


def test_a_page_and_a_script_in_the_results_run_nothing_and_change_nothing(browser, folder):
    text = (folder / "pipeline.toml").read_bytes()
    with served(folder / "out") as address:
        page = Page(browser, address)
        report = file_address(page)
        page.click("footer a")
        page.wait_until(lambda: browser.current_url == report)
        time.sleep(1.0)
        assert page.run(SAID_BY_SCRIPT) == "harmless"
        assert urlsplit(address).path.strip("/") not in report
        origin, referrer, _, reached = page.run(REACH)
        assert (origin, referrer, reached) == ("null", "", [])
        wish = {"kind": "pin", "hz": 123.0, "why": "hacked"}
        assert page.run(POST, f"{address}change", wish) == "refused"  # even if it knew the token
        browser.get(report.replace("report.html", "own.svg"))
        time.sleep(0.5)
        assert page.run("return document.querySelector('title').textContent") == "harmless"
        assert page.run("return self.origin") == "null"
    assert (folder / "pipeline.toml").read_bytes() == text
    browser.get_log("browser")


def test_the_page_itself_does_not_run_a_script_of_the_results(browser, folder):
    with served(folder / "out") as address:
        page = Page(browser, address)
        script = file_address(page).replace("report.html", "own.js")
        page.run(
            "const s = document.createElement('script'); s.src = arguments[0]; s.onload = () => { window.ran = 1; };"
            "document.body.append(s);",
            script,
        )
        time.sleep(0.5)
        assert page.run("return window.ran") is None
        assert page.run(SAID_BY_SCRIPT) != "hacked"
    browser.get_log("browser")


@pytest.mark.slow
def test_the_report_of_the_program_is_drawn_in_its_sandbox(browser, demo):
    with served(demo / "out") as address:
        page = Page(browser, address)
        browser.get(file_address(page))
        page.wait_until(lambda: page.run("return document.documentElement.dataset.drawn === 'all'"))
        assert page.run("return self.origin") == "null"
        assert page.run("return document.querySelectorAll('.main-svg').length") > 10
        assert not page.errors()


@pytest.mark.slow
def test_hostile_names_in_a_campaign_are_text_and_ask_for_nothing(browser, demo, tmp_path):
    copy_demo(demo, tmp_path)
    name = "<img src=x onerror='window.hacked = 1'>{{7*7}}"
    text = (tmp_path / "pipeline.toml").read_text(encoding="utf-8")
    named = text.replace('name = "cantilever"', f"name = {json.dumps(HOSTILE)}")
    (tmp_path / f"{name}.toml").write_text(named, encoding="utf-8")
    shutil.copytree(tmp_path / "out", tmp_path / name)
    before = {file: file.read_bytes() for file in tmp_path.glob("*.toml")}
    with served(tmp_path) as address:
        browser.get_log("performance")
        for k in range(4):
            browser.get(address if k == 0 else f"{address}{k}/")
            time.sleep(1.0)
            assert browser.execute_script("return window.hacked") is None
            assert browser.execute_script("return document.querySelectorAll('img').length") == 0
        asked = requests(browser)
        assert asked
        assert [url for url in asked if not url.startswith((address, "data:", "blob:"))] == []
    assert {file: file.read_bytes() for file in tmp_path.glob("*.toml")} == before
    browser.get_log("browser")
