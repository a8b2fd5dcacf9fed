"""What a page may do in a browser: run the scripts it was written with, and ask nothing of anybody.

A page that is sent on may be opened anywhere, and the names in it are users' and files'. The policy stands in the page,
so that a browser runs no other script and makes no request, whatever should get past the escaping of texts.
"""

from __future__ import annotations

import base64
import hashlib


def page_policy(*scripts: str) -> str:
    """Give the content security policy of a page that holds everything it needs.

    Parameters
    ----------
    *scripts : str
        Text of each script that stands in the page and may run.

    Returns
    -------
    str
        For ``<meta http-equiv="content-security-policy">``, or for a header.

    Examples
    --------
    >>> page_policy()
    "default-src 'none'; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    """
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    sources = " ".join(f"'sha256-{digest}'" for digest in digests)
    parts = ["default-src 'none'", *([f"script-src {sources}"] if sources else [])]
    # Styles of elements that the drawing library makes; pictures that a user saves. Both come from the page itself.
    parts += ["style-src 'unsafe-inline'", "img-src data: blob:", "base-uri 'none'", "form-action 'none'"]
    return "; ".join(parts)
