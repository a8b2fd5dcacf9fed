"""Blocks of code in the documentation's pages: run as they stand, and compared with what the pages say they print."""

import contextlib
import io
import os
import re
import subprocess
import sys

import pytest

BLOCK = re.compile(r"```(?P<language>sh|python)\n(?P<code>.*?)```\n(?:```text\n(?P<output>.*?)```\n)?", re.DOTALL)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TIMES = re.compile(r"  \([\d.]+ s of computing\)")
TOLERANCE = 0.02  # of numbers that are rounded on the page


def run_commands(code):
    """Run the lines of a shell; what they print."""
    command = code.replace("frf-ipz", f"'{sys.executable}' -m frf_ipz.cli.main")
    environment = os.environ | {"COLUMNS": "1000", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(["sh", "-ec", command], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def run_python(code, names):
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(code, "page", "exec"), names)
    return printed.getvalue()


def run_page(text, after=()):
    """Run the blocks of a page; after some of them what the reader is told to do. Expected and printed texts."""
    steps, names, texts = dict(after), {}, []
    for number, block in enumerate(BLOCK.finditer(text)):
        code = block["code"]
        printed = run_commands(code) if block["language"] == "sh" else run_python(code, names)
        if block["output"] is not None:
            texts.append((block["output"], TIMES.sub("", printed)))
        if number in steps:
            steps[number]()
    return texts


def assert_same(expected, printed):
    """Words are equal; numbers are, but for the last digits that another machine may round otherwise."""
    assert NUMBER.sub("#", expected).split() == NUMBER.sub("#", printed).split()
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (expected, printed)]
    assert numbers[0] == pytest.approx(numbers[1], rel=TOLERANCE, abs=1e-6)
