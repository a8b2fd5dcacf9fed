"""What computes a result beside its inputs: the code of this package, Python, and the numerical libraries.

All of it belongs to the key of every result: with other code or another library a result is computed anew.
"""

from __future__ import annotations

import hashlib
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

import frf_ipz
from frf_ipz.input_files import read_bytes

CODE = {".py", ".js", ".css", ".html"}  # what computes, and what pages are made of
PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "control")


@cache
def package_versions() -> dict[str, str]:
    """Give the versions of the packages that numbers depend on.

    Returns
    -------
    dict of str to str
        By name.
    """
    return {name: version(name) for name in PACKAGES}


@cache
def code_digest() -> str:
    """Digest the code of this package as it lies on the disk, with the scripts, styles and templates of its pages.

    Returns
    -------
    str
        SHA-256, hexadecimal.
    """
    folder = Path(frf_ipz.__file__).parent
    content = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.suffix in CODE):
        content.update(path.relative_to(folder).as_posix().encode() + b"\0" + read_bytes(path) + b"\0")
    return content.hexdigest()


def software() -> dict[str, object]:
    """Give all that computes a result beside its inputs, for its key.

    Returns
    -------
    dict
        Plain values.
    """
    return {"code": code_digest(), "python": platform.python_version(), "packages": package_versions()}
