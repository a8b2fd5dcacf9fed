"""Forces, exact responses and the measuring chain."""
