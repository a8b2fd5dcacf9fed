"""Compiled readers, and others that a damaged file may end or keep busy, in a process of their own."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from frf_ipz.errors import FileFormatError
from frf_ipz.input_files import read_bytes
from frf_ipz.numpy_files import read_numpy
from frf_ipz.output_files import write_bytes

LONGEST_S = 600.0
LAST_LETTERS = 200


def read_in_process(path: Path, module: str, *, kind: str, most_bytes: int, longest_s: float = LONGEST_S) -> Any:  # noqa: ANN401 - named arrays
    """Let ``python -m MODULE IN OUT`` turn a file into a NumPy file, and read that.

    Parameters
    ----------
    path : Path
        The file.
    module : str
        What reads the copy IN and writes the arrays OUT.
    kind : str
        What the file should be, such as ``a .full file of Ansys``.
    most_bytes : int
        Of the file, and of the arrays.
    longest_s : float
        How long it may take, s.

    Returns
    -------
    mapping of str to array
        What the module has written.

    Raises
    ------
    FileFormatError
        If the process ends without it, or takes too long.
    """
    with TemporaryDirectory() as folder:
        copy, target = Path(folder) / f"file{path.suffix.lower()}", Path(folder) / "read.npz"
        write_bytes(copy, read_bytes(path, most_bytes=most_bytes))
        command = [sys.executable, "-m", module, str(copy), str(target)]
        try:
            done = subprocess.run(command, capture_output=True, timeout=longest_s, check=False)
        except subprocess.TimeoutExpired:
            raise FileFormatError(path, f"could not be read within {longest_s:g} s; is it damaged?") from None
        if done.returncode or not target.exists():
            said = " ".join(done.stderr.decode("utf-8", "replace").split())[-LAST_LETTERS:]
            raise FileFormatError(path, f"cannot be read as {kind}: {said or 'it is damaged'}")
        return read_numpy(target, only="", most_bytes=most_bytes).arrays
