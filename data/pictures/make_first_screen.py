"""Make first_screen.png anew from a report: needs Chromium, its driver, and the extra 'test'.

python data/pictures/make_first_screen.py results/cantilever/report.html
"""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.support.wait import WebDriverWait

OPTIONS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--window-size=1280,887")
PATIENCE_S = 60.0
DRAWN = "return document.documentElement.dataset.drawn === 'all'"


def main(report: Path) -> None:
    """Photograph the top of the page in light colours."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or shutil.which("google-chrome") or ""
    for option in OPTIONS:
        options.add_argument(option)
    with webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver"))) as browser:
        browser.get(report.resolve().as_uri())
        WebDriverWait(browser, PATIENCE_S).until(lambda page: page.execute_script(DRAWN))
        screen = Image.open(io.BytesIO(browser.get_screenshot_as_png())).convert("RGB")
    screen.quantize(256, dither=Image.Dither.NONE).save(Path(__file__).with_name("first_screen.png"), optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
