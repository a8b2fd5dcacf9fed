"""Measured mode shapes, expanded over a model: what an update of its matrices cannot reach."""
