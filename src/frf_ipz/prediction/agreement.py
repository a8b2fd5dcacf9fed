"""Agreement of predicted FRFs with measured or true ones, and the agreement by shifting resonances alone.

[Grafe1998] H. Grafe, Model updating of large structural dynamics models using measured response functions, PhD thesis,
Imperial College London, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import eigh

from frf_ipz.arguments import require_type, take_array
from frf_ipz.arrays import ComplexArray, FloatArray, require_shape
from frf_ipz.late_imports import import_late
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.structure import ReducedModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd

    from frf_ipz.frf import FrfLabel
else:
    pd = import_late("pandas")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Agreement:
    """Agreement of FRFs over a band, one number an FRF.

    Parameters
    ----------
    shape : (n_frfs,) array
        Shape correlation X_S [Grafe1998]: 1 if two FRFs differ by a factor only.
    amplitude : (n_frfs,) array
        Amplitude correlation X_A [Grafe1998]: 1 if they are the same. Both are dominated by the resonances.
    median_db, largest_db : (n_frfs,) array
        Median and largest difference of the magnitudes over the lines, dB.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> frf = np.array([[1.0 + 1j], [2.0]])
    >>> frf_ipz.compare_frfs(frf, 1.1 * frf).to_frame(["1:+x / 2:+x"]).round(3)
               FRF  X_S    X_A  median dB  largest dB
    0  1:+x / 2:+x  1.0  0.995      0.828       0.828
    """

    shape: FloatArray
    amplitude: FloatArray
    median_db: FloatArray
    largest_db: FloatArray

    def to_frame(self, labels: Sequence[FrfLabel | str]) -> pd.DataFrame:
        """Give a table.

        Parameters
        ----------
        labels : sequence of FrfLabel or str
            What each FRF is called.

        Returns
        -------
        DataFrame
            One row an FRF: ``FRF, X_S, X_A, median dB, largest dB``.
        """
        columns = {"X_S": self.shape, "X_A": self.amplitude, "median dB": self.median_db, "largest dB": self.largest_db}
        return pd.DataFrame({"FRF": [str(label) for label in labels], **columns})


def compare_frfs(first: ComplexArray, second: ComplexArray) -> Agreement:
    """Compare FRFs line by line.

    Parameters
    ----------
    first, second : (n_lines, n_frfs) complex array
        In the same unit, on the same lines.

    Returns
    -------
    Agreement
        One number an FRF.

    Raises
    ------
    ShapeError
        If the shapes differ.

    Examples
    --------
    >>> import numpy as np
    >>> frf = np.array([[1.0 + 1j], [2.0]])
    >>> agreement = compare_frfs(frf, 10 * frf)
    >>> float(agreement.shape[0]).__round__(12), float(agreement.median_db[0]).__round__(12)
    (1.0, 20.0)
    """
    first = take_array("the first FRFs", first, np.complex128, (None, None), is_finite=False)
    second = take_array("the second FRFs", second, np.complex128, (None, None), is_finite=False)
    require_shape("the second FRFs", second, first.shape)
    inner = np.abs(np.sum(first.conj() * second, axis=0))
    first_power, second_power = np.sum(np.abs(first) ** 2, axis=0), np.sum(np.abs(second) ** 2, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):  # an FRF may be 0 on a line, or everywhere
        difference = np.abs(20 * np.log10(np.abs(second) / np.abs(first)))
        return Agreement(
            shape=inner**2 / (first_power * second_power),
            amplitude=2 * inner / (first_power + second_power),
            median_db=np.asarray(np.nanmedian(difference, axis=0)),
            largest_db=np.asarray(np.nanmax(difference, axis=0)),
        )


def shift_to_measured_poles(pairs: Pairs, reduced_model: ReducedModel) -> ReducedModel:
    """Give the nominal model the measured poles with its own mode shapes: the agreement that an update has to beat.

    Parameters
    ----------
    pairs : Pairs
        Measured poles with their counterparts.
    reduced_model : ReducedModel
        Before updating.

    Returns
    -------
    ReducedModel
        With measured frequencies and damping ratios, and the nominal shapes.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> pairs = frf_ipz.pair_roots(fit, reduced_model)
    >>> shifted = frf_ipz.shift_to_measured_poles(pairs, reduced_model)
    >>> bool(np.allclose(shifted.mass, reduced_model.mass))
    True
    """
    require_type("pairs", pairs, Pairs)
    require_type("reduced_model", reduced_model, ReducedModel)
    nominal = reduced_model
    squares, shapes = eigh(nominal.stiffness, nominal.mass)
    frequency = np.sqrt(np.maximum(squares, 0.0))
    rates = np.einsum("ik,ij,jk->k", shapes, nominal.damping, shapes)
    for pair in pairs.targets:
        if pair.kind == "pole":
            mode = int(np.argmin(np.abs(frequency - abs(pair.computed_value))))
            squares[mode], rates[mode] = abs(pair.measured_value) ** 2, -2 * pair.measured_value.real
    inverse = nominal.mass @ shapes
    return replace(nominal, damping=(inverse * rates) @ inverse.T, stiffness=(inverse * squares) @ inverse.T)
