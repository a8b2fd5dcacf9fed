"""The page to work on."""
