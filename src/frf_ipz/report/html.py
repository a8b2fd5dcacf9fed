"""HTML of the pages: templates of this package and of packages that build on it, in environments that escape all text.

Python gives plain data; every tag stands in a template. Only a template says what is markup, of the page's own scripts
and styles. A name that a template asks for and nobody gives is an error.
"""

from __future__ import annotations

import base64
import gzip
from functools import cache
from importlib.resources import files

from jinja2 import Environment, PackageLoader, PrefixLoader, StrictUndefined

from frf_ipz.visible_text import written_out

REPORT = "frf_ipz.report"
PLOTLY = "plotly-cartesian.min.js"
SCRIPTS = (PLOTLY, "page.js")  # of a page with pictures, in the order in which they run
RUN_SCRIPTS = (*SCRIPTS, "shapes.js")  # of the page of a run


@cache
def page_environment(*packages: str) -> Environment:
    """Make the environment of templates that stand in the folders ``templates`` of packages.

    Parameters
    ----------
    *packages : str
        Full names; ``frf_ipz.show`` has its templates under ``show/``. Those of this package are there always.

    Returns
    -------
    Environment
        Escapes all text, and refuses names that are not given.
    """
    loaders = {name.rpartition(".")[2]: PackageLoader(name) for name in (REPORT, *packages)}
    environment = Environment(
        loader=PrefixLoader(loaders),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.tests["numeric"] = _is_numeric
    environment.filters["written_out"] = written_out
    environment.policies["json.dumps_kwargs"] = {
        "ensure_ascii": False,
        "separators": (",", ":"),
        "allow_nan": False,
    }
    return environment


@cache
def read_asset(package: str, name: str) -> str:
    """Read a script or a style sheet of a package.

    Parameters
    ----------
    package : str
        Full name.
    name : str
        Of the file in the folder ``assets``.

    Returns
    -------
    str
        The text.
    """
    return (files(package) / "assets" / name).read_text(encoding="utf-8")


@cache
def packed_asset(package: str, name: str) -> str:
    """Read a script of a package as a page carries it that is sent on: in a third of its size.

    Parameters
    ----------
    package : str
        Full name.
    name : str
        Of the file in the folder ``assets``.

    Returns
    -------
    str
        Base64 of its gzip.
    """
    return base64.b64encode(gzip.compress(read_asset(package, name).encode(), mtime=0)).decode("ascii")


def _is_numeric(text: str) -> bool:
    """Tell whether a cell of a table is set as a number."""
    return bool(text) and (text[0].isdigit() or text[0] in "+-−.±")
