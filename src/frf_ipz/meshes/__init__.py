"""Meshes and wire frames from files: where nodes are, and what lies between them, for positions and for drawings."""
