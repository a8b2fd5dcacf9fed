"""State spaces and tables for other programs."""
