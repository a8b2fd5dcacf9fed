"""Formats of meshes: one module each, with a ``FORMAT``."""
