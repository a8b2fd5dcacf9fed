"""Hypotheses, their MAP fits to a measurement, and the evidence of each."""
