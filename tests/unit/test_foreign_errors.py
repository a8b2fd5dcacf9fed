"""What libraries that read files of others may do to the process that loads them."""

import subprocess
import sys

import pytest

IMPORTS = """
import sys
from pathlib import Path
import numpy as np
from frf_ipz.foreign_errors import import_reader
before = np.get_printoptions()
import_reader(Path("a"), sys.argv[1], kind="a file", extra="none")
sys.exit(np.get_printoptions() != before)
"""


@pytest.mark.parametrize("module", ["pyyeti.nastran.n2p", "asammdf", "nptdms"])
def test_a_reader_does_not_change_how_numbers_are_written(module):
    pytest.importorskip(module.partition(".")[0])
    done = subprocess.run([sys.executable, "-c", IMPORTS, module], check=False, capture_output=True)
    assert done.returncode == 0, done.stderr
