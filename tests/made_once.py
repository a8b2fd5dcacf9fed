"""What is dear to make and read by the tests of several files: made once a session, whichever worker needs it first."""

import os
import time

LONGEST_S = 600.0  # on a machine that does much else


def made_once(tmp_path_factory, name, make):
    """The folder of this name that all workers share, filled by `make`; who wants to change it copies it."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # the workers' own folders lie side by side
    folder, said = root / name, root / f"{name}.made"
    try:
        folder.mkdir()
    except FileExistsError:
        _wait_for(said)
    else:
        try:
            make(folder)
        except BaseException as error:
            _say(said, repr(error))
            raise
        _say(said, "")
    fault = said.read_text(encoding="utf-8")
    assert not fault, f"{name} could not be made: {fault}"
    return folder


def _say(path, text):
    new = path.with_suffix(".new")
    new.write_text(text, encoding="utf-8")
    new.replace(path)  # whole or not there


def _wait_for(path):
    end = time.monotonic() + LONGEST_S
    while not path.exists():
        assert time.monotonic() < end, f"another worker has not made {path.stem} within {LONGEST_S:g} s"
        time.sleep(0.05)
