"""Mistakes that users make with a sound campaign: in a unit, a sign, a place, a file or the model."""
