"""Blind three-dimensional machines: frames, folded sheets and stages on mounts, with dirty signals."""
