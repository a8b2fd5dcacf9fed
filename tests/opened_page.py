"""A page of a run in a real browser: opened, and all its pictures drawn."""

import time

PATIENCE_S = 60.0  # on a machine that does much else


def open_page(browser, path):
    """Open a page; gives the browser once all pictures are drawn."""
    browser.get(path.as_uri())
    wait_for(browser, "return document.documentElement.dataset.drawn === 'all'")
    return browser


def open_once(browser, path):
    """The page as other tests have left it, who put everything back; opened where another one is."""
    return browser if browser.current_url == path.as_uri() else open_page(browser, path)


def wait_for(browser, script):
    """Wait until a script gives something true."""
    until = time.monotonic() + PATIENCE_S
    while not browser.execute_script(script):
        assert time.monotonic() < until, f"never came true: {script}"
        time.sleep(0.05)


def errors(browser):
    """What the browser has complained of."""
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] in {"SEVERE", "WARNING"}]
