"""The diagnosis on the page."""
