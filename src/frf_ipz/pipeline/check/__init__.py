"""A look at a set-up before anything is run: what was measured, what the model is, and whether the two can be one."""
