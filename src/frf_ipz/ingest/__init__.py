"""Recordings and FRF files in, FRFs with their uncertainty out."""
