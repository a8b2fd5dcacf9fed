"""A results folder of one stage and one page, made in a moment: for the folder itself, not for what it holds."""

from pathlib import Path

import numpy as np

from frf_ipz.runs.folder import open_run
from frf_ipz.structure import Geometry


def write_text(text):
    """What writes a text."""
    return lambda path: path.write_text(text, encoding="utf-8")


def stage(folder, key, number, files=None):
    """A stage with one number for its result; what was found in the folder may be another one."""
    writers = {"model.txt": write_text(str(number))} if files is None else files
    return number_in(folder.stage("model", key, lambda: geometry(number), lambda _: writers))


def geometry(number):
    """The smallest result there is."""
    return Geometry(nodes=np.array([number]), coordinates_m=np.zeros((1, 3)), lines=np.zeros((0, 2), int))


def number_in(result):
    """The number of a stage's result."""
    return int(result.nodes[0])


def command(path, number):
    """Results with files that change, that stay, that come and that go with the number; and a page."""
    names = ("changes.txt", "stays.txt", f"only_{number}.txt", "table.json")
    with open_run(Path(path)) as folder:
        stage(folder, str(number), int(number), {name: write_text("0" if "y" in name else number) for name in names})
        folder.page("report", str(number), {"report.html": write_text(str(number))})
