"""What prediction gives: FRFs at points that were not measured."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frf_ipz.arrays import ComplexArray, FloatArray, require_shape
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.frf import FrfLabel
from frf_ipz.rational import ZeroSet
from frf_ipz.visible_text import counted

# A band that reaches farther to one side than its half width, by more than two deviations of what 200 members tell of
# the quantile q = 0.05 of a normal distribution, sqrt(q (1 - q) / 200) / (density 0.103 times 1.645), has two sides.
TOLD = 0.18


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction(Tabulated, Drawn):
    """FRFs at the points of interest.

    Parameters
    ----------
    frequency_hz : (n_lines,) array
        The measured lines of the band.
    labels : tuple of FrfLabel
        What each FRF connects, in the quantity that was measured.
    values, nominal : (n_lines, n_frfs) complex array
        After and before updating, SI.
    magnitude_low, magnitude_high : (n_lines, n_frfs) array
        90 % band of the magnitude; NaN where the method gives none.
    zeros : ZeroSet
        Zeros of the predicted FRFs.
    zero_std : (n_zeros, 2) array
        Standard deviation of their real and imaginary parts, rad/s; NaN where the method gives none.
    warnings : tuple of str
        What is known of the scale; where the band is wide, why, and what would narrow it.
    relative : tuple of int
        Numbers of the FRFs whose shape alone is predicted, with the ratios among those of one point: the test does not
        know the scale of a sensor there.

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
    >>> updated_model = frf_ipz.update_model(fit, reduced_model)
    >>> prediction = frf_ipz.predict_frfs(fit, updated_model, points=["9:+z"])
    >>> prediction
    Prediction: 9:+z / 11:+z on 790 lines from 5 to 399.5 Hz
    >>> prediction.values.shape
    (790, 1)
    """

    frequency_hz: FloatArray
    labels: tuple[FrfLabel, ...]
    values: ComplexArray
    nominal: ComplexArray
    magnitude_low: FloatArray
    magnitude_high: FloatArray
    zeros: ZeroSet
    zero_std: FloatArray
    warnings: tuple[str, ...] = ()
    relative: tuple[int, ...] = ()

    def __repr__(self) -> str:
        lines = f"{counted(len(self.frequency_hz), 'line')}"
        if len(self.frequency_hz):
            lines += f" from {self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz"
        return f"Prediction: {', '.join(map(str, self.labels))} on {lines}"

    @property
    def half_width_db(self) -> FloatArray:
        """(n_frfs,) half width of the 90 % band, the median over its lines, dB; NaN where the method gives none."""
        with np.errstate(divide="ignore", invalid="ignore"):  # a band may reach down to nothing, or be unknown
            ratios = self.magnitude_high / self.magnitude_low
        widths = np.full(len(self.labels), np.nan)
        is_known = np.isfinite(ratios).any(axis=0)
        widths[is_known] = 10 * np.log10(np.nanmedian(ratios[:, is_known], axis=0))
        return widths

    def band_db_text(self, frf: int) -> str:
        """Say how far the 90 % band of an FRF reaches, the median over its lines.

        Parameters
        ----------
        frf : int
            Its place among the labels.

        Returns
        -------
        str
            ``+-0.28 dB``, or ``-0.23 to +0.12 dB`` where it reaches farther to one side, as where the mass of the model
            is in doubt.
        """
        half = float(self.half_width_db[frf])
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.abs(self.values[:, frf])
            edges = np.array([self.magnitude_low[:, frf] / size, self.magnitude_high[:, frf] / size])
        known = np.isfinite(edges).all(axis=0) & (edges > 0).all(axis=0)
        low, high = 20 * np.log10(np.median(edges[:, known], axis=1)) if known.any() else (-half, half)
        if max(-low, high) <= (1.0 + TOLD) * half:
            return f"+-{half:.2g} dB"
        return f"{low:+.2g} to {high:+.2g} dB"

    @property
    def band_text(self) -> str:
        """The band of its lines, in words."""
        return f"{self.frequency_hz[0]:.4g} to {self.frequency_hz[-1]:.4g} Hz" if len(self.frequency_hz) else "no line"

    def __post_init__(self) -> None:
        shape = (len(self.frequency_hz), len(self.labels))
        for name in ("values", "nominal", "magnitude_low", "magnitude_high"):
            require_shape(f"the prediction's {name}", getattr(self, name), shape)
