"""A campaign in a real browser: started from the page, a sensor left out, one of several runs chosen."""

import pyarrow.parquet as pq
import pytest

from frf_ipz.pipeline.config import read_pipeline
from frf_ipz.pipeline.run import run_pipeline
from served_page import PLACE_OF_NODE, Page, served
from synthetic_campaign import hammer_campaign

pytestmark = [pytest.mark.browser, pytest.mark.slow]


def write_campaign(folder, *names):
    folder.mkdir(exist_ok=True)
    hammer_campaign(folder, noise=1e-3)
    for name in names:
        text = f'[pipeline]\nname = "{name}"\ntest = "test.toml"\n[fit]\nband_hz = [20.0, 220.0]\n'
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    return folder


def columns(run, *names):
    return pq.read_table(run / "frf.parquet").to_pandas()[list(names)]


def test_a_campaign_is_run_from_the_page_and_a_sensor_left_out(browser, tmp_path):
    folder = write_campaign(tmp_path, "pipeline")
    run = folder / "results" / "pipeline"
    with served(folder) as address:
        page = Page(browser, address)
        assert "Nothing has been run yet" in page.find("main").text
        page.click("[data-command=run]")
        page.wait_for_results("")
        assert set(columns(run, "output_dof")["output_dof"]) == {"1:+z", "2:+z"}
        page.show("#structure")
        page.click_at(page.run(PLACE_OF_NODE, "sensor", "2:+z"))
        page.wait_until(lambda: page.value("#point-form", "dof") == "2:+z")
        before = page.stamp()
        page.click("#point-form [value=sensor]")
        page.wait_for_results(before)
        assert set(columns(run, "output_dof")["output_dof"]) == {"1:+z"}
        assert read_pipeline(folder / "pipeline.toml").file.ingest.hide == ("2:+z",)
        repeated = run_pipeline(folder / "pipeline.toml", tmp_path / "again").path
        assert columns(repeated, "real", "imag").equals(columns(run, "real", "imag"))
        before = page.stamp()
        page.click("#choices [aria-label*='sensor 2:+z left out']")
        page.wait_for_results(before)
        assert set(columns(run, "output_dof")["output_dof"]) == {"1:+z", "2:+z"}
        assert not page.errors()


def test_one_of_several_is_chosen_from_a_list(browser, tmp_path):
    folder = write_campaign(tmp_path, "first", "second")
    run_pipeline(folder / "first.toml", folder / "results" / "first")
    with served(folder) as address:
        browser.get_log("browser")
        browser.get(address)
        rows = browser.find_elements("css selector", "#runs tbody tr")
        assert ["not yet" in row.text for row in rows] == [False, True]
        rows[0].find_element("css selector", "a").click()
        page = Page(browser, browser.current_url)
        assert page.find("#stabilisation .main-svg")
        assert not page.errors()
        page.click("h1 a")
        page.wait_until(lambda: browser.current_url == address)
