"""The command line before any stage is loaded."""

import os
import sys

import pytest

from frf_ipz.cli.main import THREADS, main


def test_small_matrices_are_worked_on_by_one_thread_unless_the_user_has_chosen(monkeypatch):
    for name in THREADS:
        monkeypatch.setenv(name, "2")
    for name in THREADS[1:]:
        monkeypatch.delenv(name)
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "--help"])
    with pytest.raises(SystemExit):
        main()
    assert [os.environ[name] for name in THREADS] == ["2", "1", "1"]


def test_no_command_loads_numpy_before_the_number_of_threads_is_set():
    source = f"import sys, {main.__module__}; sys.exit('numpy' in sys.modules)"
    assert os.spawnl(os.P_WAIT, sys.executable, sys.executable, "-c", source) == 0
