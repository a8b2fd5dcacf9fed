"""Labels of FRFs as a stage takes them from a fit."""

from types import SimpleNamespace


def measured(labels, frequency_hz=None):
    """Stand for what was measured: labels, and lines where they count."""
    return SimpleNamespace(labels=tuple(labels), connections=tuple(labels), frequency_hz=frequency_hz, band_hz=None)
