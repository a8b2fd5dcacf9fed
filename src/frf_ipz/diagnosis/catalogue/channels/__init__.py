"""Effects: the measuring chain."""
