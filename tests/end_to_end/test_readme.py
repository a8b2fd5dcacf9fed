"""The example of the README runs as it stands and prints what it says; the README is short and plain."""

import contextlib
import io
import re
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
MOST_WORDS, LONGEST_SENTENCE = 600, 16
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


def sentences(text):
    """Sentences of the running text as lists of words: no code, tables, headings, pictures and lists."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    text = "\n".join(line for line in text.splitlines() if not re.match(r"\s*(#|\||!\[|- )", line))
    text = re.sub(r"\]\([^)]*\)", "]", text)
    ends = r"(?<=[.!?:])(?<!\b[A-Z]\.)\s+(?=[A-Z`])|\n\s*\n"
    return [sentence.split() for sentence in re.split(ends, text) if re.search(r"\w", sentence)]


def test_the_readme_is_short():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"\S+", text)) <= MOST_WORDS
    assert median(len(sentence) for sentence in sentences(text)) <= LONGEST_SENTENCE


def test_sentences_are_counted():
    text = "# Title\n\nOne two three. Four [five](six.md) by A. Writer.\n\n| a | table |\n\n```\ncode\n```\n\n- seven\n"
    assert [len(sentence) for sentence in sentences(text)] == [3, 5]
