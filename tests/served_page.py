"""The page of a run in a browser, as somebody with a mouse has it, served by the command."""

import subprocess
import sys
from contextlib import contextmanager

import pytest

SOON_S = 120.0  # a run on a busy machine; a page that hangs ends the test

PLACE_OF_NODE = """
const plot = document.querySelector('#structure .plot');
const trace = plot.data.find((one) => one.name === arguments[0]);
const k = [...trace.text].indexOf(arguments[1]);
const { xaxis, yaxis } = plot._fullLayout, box = plot.getBoundingClientRect();
return [box.left + xaxis._offset + xaxis.d2p(trace.x[k]), box.top + yaxis._offset + yaxis.d2p(trace.y[k])];
"""


@contextmanager
def serving(folder):
    """Serve a folder by the command; gives the process and the address of its page."""
    command = [sys.executable, "-m", "frf_ipz.cli.main", "show", str(folder), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            yield server, server.stdout.readline().strip()
        finally:
            server.kill()


@contextmanager
def served(folder):
    """Serve a folder by the command; gives the address of its page."""
    with serving(folder) as (_, address):
        yield address


class Page:
    """The page, as somebody with a mouse has it."""

    def __init__(self, browser, address):
        self.browser = browser
        browser.get("about:blank")  # the page before goes on asking its server, which is no more
        browser.get_log("browser")
        browser.get(address)
        self.wait_until(self.is_drawn)

    def wait_until(self, condition):
        common = pytest.importorskip("selenium.common.exceptions")
        support = pytest.importorskip("selenium.webdriver.support.ui")
        ignored = [common.WebDriverException]
        return support.WebDriverWait(self.browser, SOON_S, ignored_exceptions=ignored).until(lambda _: condition())

    def run(self, script, *arguments):
        return self.browser.execute_script(script, *arguments)

    def is_drawn(self):
        return self.run(
            "return document.documentElement.dataset.drawn === 'all' && document.body.dataset.stamp !== undefined"
        )

    def stamp(self):
        return self.run("return document.body.dataset.stamp")

    def wait_for_results(self, before):
        self.wait_until(lambda: self.stamp() not in {None, before} and self.is_drawn())

    def show(self, selector):
        self.run("document.querySelector(arguments[0]).scrollIntoView({block: 'center'})", selector)

    def find(self, selector):
        return self.browser.find_element("css selector", selector)

    def click(self, selector):
        self.show(selector)
        self.find(selector).click()

    def click_at(self, place):
        self.pointer().move_to_location(*map(int, place)).pointer_down().pointer_up()
        self.actions.perform()

    def drag(self, places):
        pointer = self.pointer()
        pointer.move_to_location(*map(int, places[0])).pointer_down()
        for place in places[1:]:
            pointer.move_to_location(*map(int, place))
        pointer.pointer_up()
        self.actions.perform()

    def pointer(self):
        self.actions = pytest.importorskip("selenium.webdriver").ActionChains(self.browser, duration=50)
        return self.actions.w3c_actions.pointer_action

    def value(self, form, name):
        return self.run(f"return document.querySelector('{form}').elements.{name}.value")

    def write(self, form, **fields):
        for name, text in fields.items():
            field = self.find(f"{form} [name={name}]")
            field.clear()
            field.send_keys(text)

    def errors(self):
        return [entry for entry in self.browser.get_log("browser") if entry["level"] == "SEVERE"]
