"""Matrices that other FE programs exported: read, and checked."""
