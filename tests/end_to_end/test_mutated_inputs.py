"""Whatever is wrong with a file is an error of the package, soon; and a number that is none never becomes a result."""

import re
import shutil
import signal
import warnings
from contextlib import contextmanager

import pytest

import frf_ipz
from frf_ipz.pipeline.inputs import read_inputs
from frf_ipz.pipeline.run import run_in_memory
from mutated_inputs import mutations, write_inputs

LONGEST_S = 60  # of CPU: what else the machine does is no fault
FEW, MANY = 20, 1000
# The stage up to which a changed file of this kind is worked on: it has done its harm by then.
LAST_STAGE = {".mtx": "pair", ".csv": "ingest", ".unv": "ingest"}
MODEL_FILES = (".mtx", "dofs.csv")
BROKEN = re.compile(rb"[0-9](?:,[0-9]|[_x][0-9])|[0-9]\.[0-9]+\.[0-9]|--[0-9]|[0-9][eE][ \n]|\0")


class TooLongError(Exception):
    """An input that is worked on for longer than any may."""


@contextmanager
def at_most(seconds):
    if not hasattr(signal, "SIGPROF"):
        yield
        return

    def stop(*_):
        raise TooLongError

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    return write_inputs(tmp_path_factory.mktemp("originals"))


@pytest.fixture(scope="module")
def undiagnosed(tmp_path_factory):
    """The same, without a search for causes, which takes most of the time."""
    return write_inputs(tmp_path_factory.mktemp("undiagnosed"), diagnosed=False)


def work_on(folder, file):
    """Run the chain as far as this file matters; give what it says besides its results."""
    inputs = read_inputs(folder / "pipeline.toml")
    suffix = file[file.rfind(".") :]
    stage = "pair" if file.endswith(MODEL_FILES) else LAST_STAGE.get(suffix, "export")
    if file.endswith(MODEL_FILES):
        frf_ipz.solve_modes(inputs.fe_model, n_modes=min(3, len(inputs.fe_model.dofs)))
        return inputs.fe_model.notes
    results = run_in_memory(inputs, until=stage)
    return results.estimate.warnings


def faults(originals, folder, seed, count):
    """Mutations that end in anything but a result or an error of the package, or in a result from no number."""
    shutil.copytree(originals, folder, dirs_exist_ok=True)
    for mutation in mutations(originals, seed, count):
        path = folder / mutation.source / mutation.file
        path.write_bytes(mutation.data)
        name = f"{mutation.source}/{mutation.file}, {mutation.what}"
        try:
            with at_most(LONGEST_S), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                notes = work_on(path.parents[len(path.relative_to(folder).parts) - 2], mutation.file)
        except frf_ipz.FrfIpzError as error:
            if "\n" in str(error).strip():
                yield f"{name}: several lines: {error}", mutation
        except Exception as error:
            yield f"{name}: {type(error).__name__}: {error!s:.200}", mutation
        else:
            is_number_file = mutation.file.endswith(".mtx")
            if is_number_file and BROKEN.search(mutation.data) and not notes:
                yield f"{name}: a result from {BROKEN.search(mutation.data)[0]!r}", mutation
        finally:
            path.write_bytes((originals / mutation.source / mutation.file).read_bytes())


@pytest.mark.parametrize("inputs", ["undiagnosed", pytest.param("originals", marks=pytest.mark.slow)])
def test_the_originals_are_valid(request, tmp_path, inputs):
    for source in ("matrices", "uff", "records"):
        shutil.copytree(request.getfixturevalue(inputs) / source, tmp_path / source)
        assert run_in_memory(read_inputs(tmp_path / source / "pipeline.toml"), until="export").state_space is not None


def test_a_few_mutations(undiagnosed, tmp_path):
    assert not list(faults(undiagnosed, tmp_path, 1, FEW))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("inputs", "seed"), [("originals", 11), ("undiagnosed", 12), ("undiagnosed", 13), ("undiagnosed", 14)]
)
def test_many_mutations(request, tmp_path, inputs, seed):
    assert not list(faults(request.getfixturevalue(inputs), tmp_path, seed, MANY // 4))
