"""Updating against structures that are known, and against the paper: what the scripts beside it measure with."""
