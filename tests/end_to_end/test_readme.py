"""The example of the README runs as it stands and prints what it says."""

import contextlib
import io
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLE = re.compile(r"```python\n(?P<code>.*?)```\n```\n(?P<output>.*?)```", re.DOTALL)


def test_the_example_prints_what_the_readme_says(monkeypatch):
    found = EXAMPLE.search((ROOT / "README.md").read_text(encoding="utf-8"))
    monkeypatch.chdir(ROOT)
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(found["code"], "README.md", "exec"), {})
    assert printed.getvalue() == found["output"]


def test_every_file_and_folder_that_the_readme_names_is_there():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    named = re.findall(r"`((?:src|data|pipelines|tests)/[\w/.]*)`", text) + re.findall(r"\]\(([\w/.]+)\)", text)
    assert named
    assert not [name for name in named if not (ROOT / name).exists()]
