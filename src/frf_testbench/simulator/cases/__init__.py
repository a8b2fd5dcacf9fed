"""Whole cases: a specimen, a test of it, what is concealed, the files and the sealed truth."""
