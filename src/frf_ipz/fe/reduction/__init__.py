"""Reduction of the FE model: its requirements, the retained DOFs, and the reduced matrices."""
