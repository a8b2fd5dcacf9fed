"""The verdict: whether anything is missing, and whether what was found is all of it.

The limits were chosen on simulated tests that no reported rate was measured on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.polish import Data, Fit

FOUND_NATS = 25.0  # evidence over the nominal model's: what a finding needs
SECOND_NATS = 40.0  # evidence of a second finding over the first one's alone
MOST_MISFIT = 1.15  # sum of squares over the number of values
MOST_PULL = 45.0  # sum of squares of what cannot be known
MOST_OF_PIECE = 2.2  # misfit of an FRF over a piece of the band
PIECES = 6  # of the band, by points


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """How well a fit explains what was measured.

    Parameters
    ----------
    misfit : float
        Mean square of the whitened misfit.
    pull : float
        Sum of squares of what cannot be known, in standard deviations.
    worst_piece : float
        Largest mean square of an FRF over a piece of the band.
    """

    misfit: float
    pull: float
    worst_piece: float

    @property
    def is_good(self) -> bool:
        """True where nothing is left to explain."""
        return self.misfit <= MOST_MISFIT and self.pull <= MOST_PULL and self.worst_piece <= MOST_OF_PIECE

    @property
    def score(self) -> float:
        """Largest of the figures over their limits."""
        return max(self.misfit / MOST_MISFIT, self.pull / MOST_PULL, self.worst_piece / MOST_OF_PIECE)


def goodness(bench: Bench, fit: Fit) -> Goodness:
    """Measure how well a fit explains what it was fitted to.

    Parameters
    ----------
    bench : Bench
        With the data.
    fit : Fit
        Any fit.

    Returns
    -------
    Goodness
        The figures.
    """
    white = _white(bench.data, fit)
    pieces = [piece for piece in np.array_split(white, PIECES, axis=2) if piece.size]
    worst = max(float(np.mean(piece**2, axis=(1, 2)).max()) for piece in pieces)
    return Goodness(misfit=float(np.mean(white**2)), pull=fit.pull, worst_piece=worst)


def _white(data: Data, fit: Fit) -> np.ndarray:
    """Whitened misfit by FRF, real and imaginary part, and point."""
    response = fit.hypothesis.respond(fit.values, fit.unknown, data.measured.s)
    return data.misfit(response).reshape(len(data.measured.labels), 2, len(data.measured.s))
