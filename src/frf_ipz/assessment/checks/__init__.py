"""Questions that are asked of every run, one file a subject."""
