"""The command line before any stage is loaded."""

import os
import sys
from io import BytesIO, TextIOWrapper

import pytest

from frf_ipz.cli.main import THREADS, main
from frf_ipz.errors import ConvergenceError, FileFormatError, IllConditionedError, InputError


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


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (InputError("the band is empty"), 2),
        (FileFormatError("test.toml", "there is no such file"), 2),
        (ConvergenceError("the iteration stopped after 30 steps"), 1),
        (IllConditionedError("the mass matrix is singular"), 1),
    ],
    ids=lambda value: type(value).__name__,
)
def test_an_error_is_one_line_and_says_by_its_status_whose_it_is(monkeypatch, capsys, error, status):
    def fail(path):  # noqa: ARG001  as the function that it stands for
        raise error

    monkeypatch.setattr("frf_ipz.pipeline.inputs.read_inputs", fail)
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", "pipeline.toml"])
    with pytest.raises(SystemExit) as stopped:
        main()
    assert stopped.value.code == status
    assert capsys.readouterr().err == f"frf-ipz: {error}\n"


def test_a_name_that_the_console_has_no_letters_for_stops_nothing(monkeypatch):
    narrow = TextIOWrapper(BytesIO(), encoding="cp1252", write_through=True)
    monkeypatch.setattr(sys, "stdout", narrow)
    monkeypatch.setattr(sys, "argv", ["frf-ipz", "check", "pipeline.toml"])
    monkeypatch.setattr("frf_ipz.pipeline.inputs.read_inputs", lambda path: path)
    monkeypatch.setattr("frf_ipz.pipeline.check.setup.describe_setup", lambda inputs: f"Träger \u6881 of {inputs}")
    with pytest.raises(SystemExit) as stopped:
        main()
    assert not stopped.value.code
    assert narrow.buffer.getvalue().decode("cp1252").split() == ["Träger", "\\u6881", "of", "pipeline.toml"]
