"""The reduced model brought to the measured poles and zeros."""
