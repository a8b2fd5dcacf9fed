"""Pairing of measured poles and zeros with those of the model."""
