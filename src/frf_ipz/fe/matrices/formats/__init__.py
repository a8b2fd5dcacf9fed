"""Formats of matrices: each module with a ``FORMAT`` is one."""
