"""The folder that a run leaves: exact results for later stages, tables for users, and what ran."""
