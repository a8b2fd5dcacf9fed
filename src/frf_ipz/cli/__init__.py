"""The command ``frf-ipz``."""
