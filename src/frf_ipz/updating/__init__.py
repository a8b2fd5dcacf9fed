"""Updating of the reduced model to the measured poles and zeros."""
