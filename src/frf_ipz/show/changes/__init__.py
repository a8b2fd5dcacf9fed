"""What a user changes on the page, as changes of ``pipeline.toml``."""
