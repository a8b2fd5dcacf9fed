"""What identification gives: poles, residues and zeros with their covariance, and how they were identified."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import BoolArray, FloatArray, require_shape
from frf_ipz.display import Drawn, Tabulated
from frf_ipz.errors import ShapeError
from frf_ipz.frf import FrfLabel, FrfSet
from frf_ipz.identification.options import Stability
from frf_ipz.identification.root_covariance import RootCovariance, pair_blocks
from frf_ipz.identification.window_removal import remove_window
from frf_ipz.late_imports import import_late
from frf_ipz.modes import ModalParameters
from frf_ipz.rational import PoleResidueModel, ZeroSet, natural_frequency_hz
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    import pandas as pd
else:
    pd = import_late("pandas")

MODES_SHOWN = 6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalFit(Tabulated, Drawn):
    """A rational model of a set of measured FRFs.

    Parameters
    ----------
    model : PoleResidueModel
        Fitted to the FRFs as they were measured (signs and quantities of the labels). Its first `n_modes` poles are the
        modes of the band, by ascending frequency; further ones stand for what lies outside.
    n_modes : int
        Number of modes in the band.
    labels : tuple of FrfLabel
        Columns of the residues.
    band_hz : pair of float
        The band that was fitted.
    used_lines : (n_lines,) bool array
        Lines of the FrfSet that were fitted.
    frequency_hz : (n_used,) array
        These lines, Hz.
    zeros : ZeroSet
        Zeros of every FRF, in the band and near it.
    covariance : (2 n, 2 n) array, or RootCovariance
        Joint covariance of the `n_modes` poles, then of the zeros: real and imaginary part of each in turn, (rad/s)^2.
        Rows of zeros that are not identifiable hold infinity on the diagonal and 0 elsewhere.
    residue_covariance : (n_modes, n_frfs, 2, 2) array
        Covariance of real and imaginary part of each residue.
    value_std : (n_used, n_frfs) array
        Standard deviation of the fitted FRF on the used lines, in units of the FRF (of the complex value's modulus).
    stabilization : DataFrame
        One row a pole of the diagram: ``order, frequency_hz, damping_ratio, stable_frequency, stable_damping,
        stable_shape``; ``taken`` as a start; ``mode``, the mode of the fit in whose column it stands, or 0.
    decisions : DataFrame
        What was added, dropped, pinned and rejected: ``frequency_hz, damping_ratio, action, reason``.
    modes : DataFrame
        One row a mode: ``pole_id, frequency_hz, damping_ratio, mpc, quality`` and what the quality is made of.
    misfit : DataFrame
        One row an FRF and band: ``frf, output_dof, input_dof, band_low_hz, band_high_hz, misfit, noise, ratio``, and
        what was fitted of the FRF as a whole: ``delay_s, gain, gain_std``.
    gain : (n_frfs,) array
        Gain of each FRF: the measured FRF over the true one. 1 unless its gain was estimated.
    channel_gains : DataFrame
        One row a channel whose gain was estimated: ``channel, gain, gain_std``.
    noise_from : str
        ``recordings`` or ``misfit``: where the covariance's sigma comes from; ``stated`` for modes that were identified
        elsewhere.
    warnings : tuple of str
        What the user has to know.
    unknown_scale : str
        ``none``, ``common`` or ``per_channel``, as the FRFs say: gains that are fitted once there is a model.
    stability : Stability
        Tolerances of the stabilisation diagram.
    missed : (n_used, n_frfs) array, optional
        How far measured values lie from the fitted FRF, in units of the FRF, where that is more than the noise gives at
        any of the lines; else 0. Such lines hold a mode that was not identified, or what no linear model has.
    modes_given : ModalParameters, optional
        Modes that were identified elsewhere: the fit of a test without FRFs has them in the place of residues.

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
    >>> fit
    ModalFit: 3 modes at 16.45, 103.04, 288.36 Hz, 5 zeros of 2 FRFs
    >>> fit.modes[["frequency_hz", "damping_ratio"]].round(4)
       frequency_hz  damping_ratio
    0       16.4492           0.01
    1      103.0400           0.01
    2      288.3602           0.01
    """

    model: PoleResidueModel
    n_modes: int
    labels: tuple[FrfLabel, ...]
    band_hz: tuple[float, float]
    used_lines: BoolArray
    frequency_hz: FloatArray
    zeros: ZeroSet
    covariance: FloatArray | RootCovariance
    residue_covariance: FloatArray
    value_std: FloatArray
    stabilization: pd.DataFrame
    decisions: pd.DataFrame
    modes: pd.DataFrame
    misfit: pd.DataFrame
    gain: FloatArray
    channel_gains: pd.DataFrame
    noise_from: str
    warnings: tuple[str, ...] = ()
    unknown_scale: str = "none"
    modes_given: ModalParameters | None = None
    stability: Stability = field(default_factory=Stability)
    missed: FloatArray | None = None

    @property
    def connections(self) -> tuple[FrfLabel, ...]:
        """What a model's FRFs connect: `labels`, or sensors and forces of modes that were identified elsewhere."""
        return self.labels if self.modes_given is None else self.modes_given.labels

    def without_window(self, frfs: FrfSet) -> FrfSet:
        """Carry FRFs that were measured under an exponential window over to the imaginary axis.

        The windowed values are exact at s = sigma + i omega. What the fitted model changes between there and i omega is
        added to them: noise and whatever the model does not contain stay as they were measured. What is not known of
        poles and residues counts in the variance, as if both were independent, and so does what the rest may change by.

        Parameters
        ----------
        frfs : FrfSet
            What was fitted, with a window or without.

        Returns
        -------
        FrfSet
            Without a window.
        """
        if not frfs.window_decay_1_s:
            return frfs
        values, unmodelled = remove_window(frfs, self.model, self.n_modes, band_hz=self.band_hz)
        s, at_window = 2j * np.pi * frfs.frequency_hz, frfs.s
        poles, residues = self.model.poles[: self.n_modes], self.model.residues[: self.n_modes]
        by_residue, by_pole = (
            np.abs((s[:, None] - poles) ** -power - (at_window[:, None] - poles) ** -power) ** 2 for power in (1, 2)
        )
        pole_variance = np.trace(pair_blocks(self.covariance)[: self.n_modes], axis1=1, axis2=2)
        added = by_pole @ (pole_variance[:, None] * np.abs(residues) ** 2)
        added += by_residue @ np.trace(self.residue_covariance, axis1=2, axis2=3)
        is_carried = (frfs.frequency_hz > 0)[:, None]  # at 0 Hz the model may have no value
        return replace(
            frfs,
            values=values,
            variance=frfs.variance + np.where(is_carried, added, 0.0) + unmodelled,
            window_decay_1_s=0.0,
        )

    def __repr__(self) -> str:
        values = [f"{hertz:.2f}" for hertz in natural_frequency_hz(self.model.poles[: self.n_modes])]
        listed = ", ".join(values[:MODES_SHOWN]) + (", ..." if len(values) > MODES_SHOWN else "")
        if self.modes_given is not None:
            return f"ModalFit: {counted(self.n_modes, 'mode')} at {listed} Hz, identified elsewhere"
        zeros = f"{counted(int(self.zeros.identifiable.sum()), 'zero')} of {counted(len(self.labels), 'FRF')}"
        modes = f"{counted(self.n_modes, 'mode')} at {listed} Hz" if values else "no modes"
        return f"ModalFit: {modes}, {zeros}"

    def __post_init__(self) -> None:
        size = 2 * (self.n_modes + len(self.zeros.values))
        if self.covariance.shape != (size, size):
            raise ShapeError(f"the covariance has the shape {self.covariance.shape}; needed is ({size}, {size})")
        require_shape("the covariance of the residues", self.residue_covariance, (self.n_modes, len(self.labels), 2, 2))
