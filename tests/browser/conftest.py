"""A real browser, and the demo served to it."""

import shutil

import pytest

from demo_case import copy_demo, made_demo
from served_page import served

HOW = "(Debian: apt-get install chromium chromium-driver; pip install selenium)"


@pytest.fixture(scope="session")
def browser():
    """Chromium without a window."""
    webdriver = pytest.importorskip("selenium.webdriver", reason=f"needs selenium {HOW}")
    chromium, driver = shutil.which("chromium") or shutil.which("google-chrome"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip(f"needs Chromium and its driver {HOW}")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--window-size=1300,1000",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    chrome = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield chrome
    chrome.quit()


@pytest.fixture(scope="module", autouse=True)
def nothing_of_other_tests(browser):
    """Leave the last page of a module, and forget what it said: it goes on asking a server that has stopped."""
    yield
    browser.get("about:blank")
    browser.get_log("browser")


@pytest.fixture
def left_changed(browser):
    """For tests that do not put everything back: the next one opens the page anew."""
    yield
    browser.get("about:blank")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    return copy_demo(made_demo(tmp_path_factory), tmp_path_factory.mktemp("served"))


@pytest.fixture(scope="module")
def address(demo):
    """Address of the page of the demo, served by the command."""
    with served(demo / "out") as address_of_page:
        yield address_of_page
