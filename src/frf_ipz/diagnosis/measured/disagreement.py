"""How much records disagree, over what their noise explains: what a model cannot be asked to explain.

Noise is known channel by channel. What disturbs one FRF in a part of the band only, the rest of a hum or a loose cable,
shows where a record that was held out differs from the others by more than the noise of both.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.transfer_functions import make_whitening

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.diagnosis.measured.data_split import DataSplit

N_SUBBANDS = 6  # of the band, by points


def average_over_subbands(white: FloatArray) -> FloatArray:
    """Average squares of whitened errors over parts of the band.

    Parameters
    ----------
    white : (n_frfs, 2, n_points) array
        Real and imaginary part of each FRF.

    Returns
    -------
    (n_frfs, n_subbands) array
        1 where errors are as expected; as many subbands as there are points for, `N_SUBBANDS` at most.
    """
    parts = [part for part in np.array_split(white**2, N_SUBBANDS, axis=2) if part.size]
    return np.stack([np.mean(part, axis=(1, 2)) for part in parts], axis=1)


def measure_disagreement(source: DataSplit, tolerance: float) -> FloatArray:
    """Measure by how much records disagree in each FRF and part of the band.

    Parameters
    ----------
    source : DataSplit
        Training data, and what is held out.
    tolerance : float
        Relative tolerance of the model, as for the whitening of the data.

    Returns
    -------
    (n_frfs, n_subbands) array
        Mean square of the difference over what noise and tolerance explain; at least 1, and 1 where no records were
        held out.
    """
    training, held_out = source.training, source.held_out
    if source.held_out_kind != "records":
        return np.ones_like(average_over_subbands(np.ones((len(training.labels), 2, len(training.s)))))
    pairs = zip(training.shared_errors, held_out.shared_errors, strict=True)
    both = replace(
        training,
        covariance=training.covariance + held_out.covariance,
        shared_errors=tuple(np.hstack(pair) for pair in pairs),
    )
    white = make_whitening(both, tolerance=tolerance)(training.values - held_out.values)
    squares = average_over_subbands(white.reshape(len(training.labels), 2, len(training.s)))
    return np.asarray(np.maximum(squares, 1.0))
