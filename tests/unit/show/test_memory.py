"""However many pipelines there are, the server keeps the results of one of them."""

import os
import re
import shutil
import sys
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from served_page import serving

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="what is resident is read from /proc")
SOON_S = 120.0
FEW, LOOKED_AT, MANY = 5, 40, 300
MOST_MB_EACH = 0.3  # results of the demo and all that is made of them take 9 MB
MOST_MB = 400


def copy_linked(made, folder):
    """Copy a run by links, which cost no space; what names the folder is the copy's own."""
    shutil.copytree(made, folder, copy_function=os.link)
    for manifest in (folder / "out").rglob("run.json"):
        text = manifest.read_text(encoding="utf-8")
        manifest.unlink()
        manifest.write_text(text.replace(str(made), str(folder)), encoding="utf-8")


def make_campaign(made, folder, n_pipelines):
    for number in range(n_pipelines):
        copy_linked(made, folder / f"machine{number:03d}")
    return folder


def resident_mb(process, kind="VmRSS"):
    text = Path(f"/proc/{process.pid}/status").read_text(encoding="ascii")
    return int(re.search(rf"{kind}:\s+(\d+) kB", text)[1]) / 1024


def look_at(address, *paths):
    """Ask for pages as a browser does; gives the last one."""
    parts = urlsplit(address)
    for path in paths:
        with closing(HTTPConnection(parts.hostname, parts.port, timeout=SOON_S)) as connection:
            connection.request("GET", parts.path + path)
            answer = connection.getresponse()
            text = answer.read()
            assert answer.status == 200, (path, text[:200])
    return text


def look_at_run(address, number):
    """Look at a run: its page, a shape, a range of its FRFs."""
    look_at(address, f"{number}/", f"{number}/shape?mode=0", f"{number}/zoom?low=100&high=104&frfs=0,1")


@pytest.mark.slow
def test_300_pipelines_take_at_most_400_mb(original, tmp_path):
    """One run after another is looked at; memory grows with none of them."""
    folder = make_campaign(original, tmp_path / "campaign", MANY)
    with serving(folder) as (process, address):
        assert look_at(address, "").count(b'scope="row"') == MANY
        for number in range(1, FEW + 1):
            look_at_run(address, number)
        few = resident_mb(process)
        for number in range(FEW + 1, LOOKED_AT + 1):
            look_at_run(address, number)
        assert (resident_mb(process) - few) / (LOOKED_AT - FEW) < MOST_MB_EACH
        assert resident_mb(process, "VmHWM") < MOST_MB
