"""Numbers as a paper prints them: cut off, not rounded."""

import numpy as np

PRINTED_DIGITS = 3


def cut(values, digits=PRINTED_DIGITS):
    unit = 10.0 ** (np.floor(np.log10(values)) - digits + 1)
    return np.floor(values / unit) * unit
