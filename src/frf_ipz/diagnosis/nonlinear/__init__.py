"""Nonlinear laws: the test of linearity, the search for a law and its location, and the simulation with it."""
