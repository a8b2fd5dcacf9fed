"""Recordings without what is not the answer of the machine to the force in them."""
