"""A page that is sent on, in a real browser: only its own scripts run, nothing leaves, nothing can be uploaded."""

import json
import threading
import time
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from frf_ipz.report.page import write_report
from frf_ipz.runs.results import Results
from hostile_run import hostile_folder
from opened_page import open_page

pytestmark = pytest.mark.browser

UPLOADS = ("cloud", "share", "studio")
FOREIGN = """
<script>window.hacked = 1</script><img src="ADDRESS/image"><svg onload="window.hacked = 1"></svg>
<link rel="stylesheet" href="ADDRESS/style"><iframe src="ADDRESS/frame"></iframe>
<form id="foreign" action="ADDRESS/form" method="post" target="_self"><input name="a" value="1"></form>
<style>body { background: url(ADDRESS/background); } @font-face { font-family: x; src: url(ADDRESS/font); }</style>
"""
TRY_ALL = """
const [address, html] = arguments;
const script = Object.assign(document.createElement('script'), {textContent: 'window.hacked = 1'});
document.body.append(script, document.createRange().createContextualFragment(html));
document.body.style.fontFamily = 'x';
document.body.setAttribute('onclick', 'window.hacked = 1');
document.body.click();
document.getElementById('foreign').submit();
navigator.sendBeacon(address + '/beacon', 'data');
new Image().src = address + '/picture';
try { new WebSocket(address.replace('http', 'ws') + '/socket'); } catch { }
try { new Worker(address + '/worker.js'); } catch { }
return fetch(address + '/fetch', {mode: 'no-cors'}).then(() => 'sent', () => 'refused');
"""


@contextmanager
def listening():
    """Somebody who waits for requests; gives the address, and the paths that were asked for."""
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_response(204)
            self.end_headers()

        do_POST = do_GET  # noqa: N815  the name that http.server asks for

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}", asked
    server.shutdown()
    server.server_close()


def requests(browser):
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    return [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]


@pytest.fixture
def written(tmp_path):
    path = tmp_path / "report.html"
    write_report(Results(hostile_folder()), path)
    return path


def test_a_page_with_hostile_names_asks_for_nothing_and_runs_nothing_of_theirs(browser, written):
    browser.get_log("performance")
    open_page(browser, written)
    asked = [url for url in requests(browser) if not url.startswith(("data:", "blob:"))]
    assert asked == [written.as_uri()]
    assert browser.execute_script("return window.hacked") is None
    assert [file.name for file in written.parent.iterdir()] == ["report.html"]


def test_markup_that_got_in_could_neither_run_nor_send(browser, written):
    open_page(browser, written)
    with listening() as (address, asked):
        answer = browser.execute_script(TRY_ALL, address, FOREIGN.replace("ADDRESS", address))
        time.sleep(1.0)
        assert (answer, asked) == ("refused", [])
    assert browser.execute_script("return window.hacked") is None
    assert browser.current_url == written.as_uri()
    browser.get_log("browser")  # full of what was refused


def test_the_listener_hears_a_page_without_a_policy(browser, tmp_path):
    path = tmp_path / "open.html"
    path.write_text("<!DOCTYPE html><title>open</title><body></body>", encoding="utf-8")
    browser.get(path.as_uri())
    with listening() as (address, asked):
        assert browser.execute_script(TRY_ALL, address, FOREIGN.replace("ADDRESS", address)) == "sent"
        time.sleep(1.0)
        assert {"/fetch", "/picture", "/beacon", "/image"} <= set(asked)
    browser.get_log("browser")


def test_no_picture_can_be_uploaded_and_each_can_be_saved(browser, written):
    open_page(browser, written)
    titles = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].map((p) => [...p.querySelectorAll('.modebar-btn')]"
        ".map((b) => (b.getAttribute('data-title') || '').toLowerCase()))"
    )
    assert titles
    assert all(any("png" in title for title in buttons) for buttons in titles)
    assert not [title for buttons in titles for title in buttons if any(word in title for word in UPLOADS)]
    places = "return [...document.querySelectorAll('.plot')].map((p) => p._context.plotlyServerURL)"
    assert set(browser.execute_script(places)) == {""}
    saved = "return Plotly.toImage(document.querySelector('#frf .plot'), {format: 'png'}).then((url) => url.length)"
    assert browser.execute_script(saved) > 1000
