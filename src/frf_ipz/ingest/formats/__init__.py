"""File formats, one a module; a module that has a ``FORMAT`` is found by itself (see `registry`)."""
