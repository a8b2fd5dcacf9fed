"""Effects: how motion is lost."""
