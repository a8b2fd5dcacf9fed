"""What prediction gives: FRFs at points that were not measured."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.arrays import ComplexArray, FloatArray, require_shape
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.frf import FrfLabel
from frf_ipz.rational import ZeroSet


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
        Where the band is wide, why, and what would narrow it.
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

    def __repr__(self) -> str:
        lines = f"{len(self.frequency_hz)} lines"
        if len(self.frequency_hz):
            lines += f" from {self.frequency_hz[0]:g} to {self.frequency_hz[-1]:g} Hz"
        return f"Prediction: {', '.join(map(str, self.labels))} on {lines}"

    def __post_init__(self) -> None:
        shape = (len(self.frequency_hz), len(self.labels))
        for name in ("values", "nominal", "magnitude_low", "magnitude_high"):
            require_shape(f"the prediction's {name}", getattr(self, name), shape)
