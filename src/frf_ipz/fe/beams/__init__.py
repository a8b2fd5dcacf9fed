"""Straight beams: elements, fields between the nodes, and other versions of a beam."""
