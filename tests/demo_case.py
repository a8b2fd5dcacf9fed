"""The demo in a folder of its own, run once: tests copy it and change what they like."""

import shutil
from pathlib import Path

from frf_ipz.pipeline.run import run_pipeline
from made_once import made_once

ROOT = Path(__file__).parents[1]


def made_demo(tmp_path_factory):
    """The folder of the demo, for all tests of a session: to be read, or copied."""
    return made_once(tmp_path_factory, "demo", make_demo)


def make_demo(folder):
    """Put test, model and pipeline of the demo into a folder, and run it into ``out``."""
    shutil.copytree(ROOT / "data" / "raw" / "cantilever", folder / "cantilever")
    shutil.copy(ROOT / "data" / "reference" / "cantilever_poi_frf.csv", folder)
    text = (ROOT / "pipelines" / "cantilever.toml").read_text(encoding="utf-8")
    text = text.replace("../data/raw/", "").replace("../data/reference/", "")
    text = text.replace("[diagnose]", '[diagnose]\nrun = "never"')  # half of its time
    (folder / "pipeline.toml").write_text(text, encoding="utf-8")
    run_pipeline(folder / "pipeline.toml", folder / "out")
    return folder


def copy_demo(made, folder):
    """Copy it; the copy's results name the copy's pipeline file."""
    shutil.copytree(made, folder, dirs_exist_ok=True)
    for manifest in (folder / "out").rglob("run.json"):  # what users open, and that of the generation
        manifest.write_text(manifest.read_text(encoding="utf-8").replace(str(made), str(folder)), encoding="utf-8")
    return folder
