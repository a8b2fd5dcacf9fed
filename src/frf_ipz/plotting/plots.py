"""Plots for publications: results in, Matplotlib axes out.

Each function describes a picture, as the report shows it, and draws one of its panels. They take results and compute
nothing; none opens a window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_each, require_type, take_array
from frf_ipz.diagnosis.measured.levels import LevelDependence
from frf_ipz.diagnosis.result import Diagnosis, LawInTime
from frf_ipz.dofs import as_dofs
from frf_ipz.errors import InputError
from frf_ipz.frf import FrfSet
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.ingest.frf_estimate import FrfEstimate
from frf_ipz.late_imports import import_late
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.plotting.cmif import describe_cmif
from frf_ipz.plotting.diagnosis import describe_mismatch, describe_proof, describe_ranking
from frf_ipz.plotting.figures import draw_panel
from frf_ipz.plotting.frfs import describe_fit, describe_frfs
from frf_ipz.plotting.nonlinear import describe_law_force, describe_law_response, describe_level_modes
from frf_ipz.plotting.poles import describe_pairs, describe_pole_zero_map, describe_stabilization
from frf_ipz.plotting.prediction import describe_prediction
from frf_ipz.plotting.records import describe_forces, describe_responses
from frf_ipz.plotting.structure import StructureMarks, describe_structure
from frf_ipz.plotting.updating import describe_convergence, describe_stiffness_change, describe_targets
from frf_ipz.prediction.prediction import Prediction
from frf_ipz.runs.picture_data import mode_indicator
from frf_ipz.structure import Geometry
from frf_ipz.updating.targets import Target
from frf_ipz.updating.updated_model import UpdatedModel

if TYPE_CHECKING:
    from collections.abc import Sequence

    import pandas as pd
    from matplotlib.axes import Axes

    from frf_ipz.arrays import ComplexArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.plotting.picture import Picture
else:
    pd = import_late("pandas")


def plot_records(estimate: FrfEstimate, *, ax: Axes | None = None) -> Axes:
    """Draw the forces of all records; those left out are dotted.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Forces over time, aligned where they set in.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> estimate = frf_ipz.estimate_frfs(test)
    >>> ax = frf_ipz.plotting.plot_records(estimate)
    >>> ax.get_ylabel()
    'force, N'
    """
    require_type("estimate", estimate, FrfEstimate)
    return _draw(describe_forces(estimate), ax, "no force was recorded")


def plot_responses(estimate: FrfEstimate, *, ax: Axes | None = None) -> Axes:
    """Draw the responses of the first channel in all records; those left out are dotted.

    Parameters
    ----------
    estimate : FrfEstimate
        The result of ingest.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Responses over time.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> estimate = frf_ipz.estimate_frfs(test)
    >>> ax = frf_ipz.plotting.plot_responses(estimate)
    >>> ax.get_ylabel()
    'output 1, m/s^2'
    """
    require_type("estimate", estimate, FrfEstimate)
    return _draw(describe_responses(estimate), ax, "no response was recorded")


def plot_frfs(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the magnitudes of measured FRFs with their 95 % bands.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs; ``select_frfs`` and ``select_lines`` choose.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_frfs(frfs)
    >>> ax.get_ylabel()
    'Accelerance, m/s^2/N'
    """
    require_type("frfs", frfs, FrfSet)
    return draw_panel(describe_frfs(frfs), ax)


def plot_phases(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the phases of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_phases(frfs)
    >>> ax.get_ylabel()
    'Phase, °'
    """
    require_type("frfs", frfs, FrfSet)
    return draw_panel(describe_frfs(frfs), ax, panel=1)


def plot_coherence(frfs: FrfSet, *, ax: Axes | None = None) -> Axes:
    """Draw the coherence of measured FRFs.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> time = np.arange(4000) / 2000.0
    >>> recordings = []
    >>> for peak in (40.0, 60.0, 80.0):
    ...     force = np.zeros(4000)
    ...     force[200:206] = peak * np.sin(np.pi * np.arange(6) / 5)
    ...     decay = np.exp(-20 * time) * np.sin(2 * np.pi * 80 * time)
    ...     response = np.convolve(force, np.gradient(np.gradient(decay, 5e-4), 5e-4))[:4000] * 5e-4 * 1e-3
    ...     recordings.append(
    ...         frf_ipz.Recording(
    ...             force=force, responses=response, sample_rate_hz=2000.0, input_dof="1:+z", output_dofs=["1:+z"]
    ...         )
    ...     )
    >>> test = frf_ipz.VibrationTest.from_recordings(recordings)
    >>> estimate = frf_ipz.estimate_frfs(test)
    >>> ax = frf_ipz.plotting.plot_coherence(estimate.frfs)
    >>> ax.get_ylabel()
    'Coherence'
    """
    require_type("frfs", frfs, FrfSet)
    picture = describe_frfs(frfs)
    if len(picture.panels) < 3:
        raise InputError("the coherence of these FRFs is not known")
    return draw_panel(picture, ax, panel=2)


def plot_fit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw measured FRFs as points, fitted ones as lines, and the 95 % bands of the fit.

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_fit(frfs, fit)
    >>> ax.get_ylabel()
    'Accelerance, m/s^2/N'
    """
    require_type("frfs", frfs, FrfSet)
    require_type("fit", fit, ModalFit)
    return draw_panel(describe_fit(frfs, fit), ax)


def plot_misfit(frfs: FrfSet, fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw the modulus of measurement minus fit, and the standard deviation of the measurement (dotted).

    Parameters
    ----------
    frfs : FrfSet
        The FRFs that were fitted, on all their lines.
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_misfit(frfs, fit)
    >>> ax.get_ylabel()
    'Misfit, m/s^2/N'
    """
    require_type("frfs", frfs, FrfSet)
    require_type("fit", fit, ModalFit)
    return draw_panel(describe_fit(frfs, fit), ax, panel=1)


def plot_cmif(frfs: FrfSet, fit: ModalFit | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the complex mode indicator function, and the modes of a fit.

    Parameters
    ----------
    frfs : FrfSet
        Measured FRFs.
    fit : ModalFit, optional
        Its modes are marked.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> frfs = frf_ipz.FrfSet.from_arrays(lines, values, outputs=[middle, tip], inputs=[tip])
    >>> ax = frf_ipz.plotting.plot_cmif(frfs)
    >>> ax.get_ylabel()
    'Accelerance, m/s^2/N'
    """
    require_type("frfs", frfs, FrfSet)
    require_type("fit", fit, ModalFit, optional=True)
    return draw_panel(describe_cmif(mode_indicator(frfs), fit), ax)


def plot_stabilization(fit: ModalFit, frfs: FrfSet | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the stabilisation diagram: poles over model order, and the modes of the fit.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    frfs : FrfSet, optional
        Measured FRFs, whose sum is drawn behind.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_stabilization(fit)
    >>> ax.get_xlabel()
    'Frequency, Hz'
    """
    require_type("fit", fit, ModalFit)
    require_type("frfs", frfs, FrfSet, optional=True)
    return draw_panel(describe_stabilization(fit, frfs), ax)


def plot_pole_zero_map(fit: ModalFit, *, ax: Axes | None = None) -> Axes:
    """Draw poles and zeros over frequency and damping ratio, with the ellipses that hold them with 95 %.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_pole_zero_map(fit)
    >>> ax.get_xlabel()
    'Frequency, Hz'
    """
    require_type("fit", fit, ModalFit)
    return draw_panel(describe_pole_zero_map(fit), ax)


def plot_pairs(pairs: Pairs, *, ax: Axes | None = None) -> Axes:
    """Draw measured (upper) and computed (lower) poles and zeros, linked where they are paired.

    Parameters
    ----------
    pairs : Pairs
        Who belongs to whom.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        One lane for the poles and one for the zeros of each FRF.

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
    >>> ax = frf_ipz.plotting.plot_pairs(frf_ipz.pair_roots(fit, reduced_model))
    >>> ax.get_xlabel()
    'Frequency, Hz'
    """
    require_type("pairs", pairs, Pairs)
    return draw_panel(describe_pairs(pairs), ax)


def plot_targets(targets: Sequence[Target], *, ax: Axes | None = None) -> Axes:
    """Draw the frequency errors of an update's targets, before and after.

    Parameters
    ----------
    targets : sequence of Target
        What `updating.targets.target_rows` gives.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    require_each("targets", targets, Target)
    return _draw(describe_targets(targets), ax, "the update had no targets")


def plot_convergence(updated: UpdatedModel, *, ax: Axes | None = None) -> Axes:
    """Draw the misfit of the targets over the iterations.

    Parameters
    ----------
    updated : UpdatedModel
        The update.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.

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
    >>> ax = frf_ipz.plotting.plot_convergence(updated_model)
    >>> ax.get_xlabel()
    'Iteration'
    """
    require_type("updated", updated, UpdatedModel)
    return _draw(describe_convergence(updated), ax, "the update took one step")


def plot_stiffness_change(parts: pd.DataFrame, *, ax: Axes | None = None) -> Axes:
    """Draw how much stiffer or softer every part of the FE model has become, with its 90 % band.

    Parameters
    ----------
    parts : DataFrame
        ``UpdatedModel.parts``.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Over the position for a structure that is a line, else coloured points.

    Raises
    ------
    InputError
        If there is nothing to draw.

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
    >>> updated_model = frf_ipz.update_model(fit, reduced_model, fe_model=beam)
    >>> ax = frf_ipz.plotting.plot_stiffness_change(updated_model.parts)
    >>> ax.get_ylabel()
    'Change of stiffness, %'
    """
    require_type("parts", parts, pd.DataFrame)
    return _draw(describe_stiffness_change(parts), ax, "the update has changed no named parts")


def plot_prediction(
    prediction: Prediction, *, frf: int = 0, measured: ComplexArray | None = None, ax: Axes | None = None
) -> Axes:
    """Draw a predicted FRF with its 90 % band, beside the nominal one.

    Parameters
    ----------
    prediction : Prediction
        The prediction.
    frf : int
        Which of its FRFs.
    measured : (n_lines,) complex array, optional
        What was measured there, on the lines of the prediction, in SI units.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

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
    >>> ax = frf_ipz.plotting.plot_prediction(prediction)
    >>> ax.get_ylabel()
    'Accelerance, m/s^2/N'
    """
    require_type("prediction", prediction, Prediction)
    if frf not in range(len(prediction.labels)):
        raise InputError(f"the prediction has no FRF {frf!r}; it has 0 to {len(prediction.labels) - 1}")
    if measured is not None:
        measured = take_array(
            "the measured FRF", measured, np.complex128, (len(prediction.frequency_hz),), is_finite=False
        )
    return draw_panel(describe_prediction(prediction, frf, measured), ax)


def plot_structure(
    geometry: Geometry,
    *,
    sensors: Sequence[AnyDof | str] = (),
    inputs: Sequence[AnyDof | str] = (),
    points: Sequence[AnyDof | str] = (),
    ax: Axes | None = None,
) -> Axes:
    """Draw a structure with sensors, inputs and points of interest.

    Parameters
    ----------
    geometry : Geometry
        Of the FE model.
    sensors, inputs, points : sequence of Dof or str
        What to mark.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        With the picture.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> ax = frf_ipz.plotting.plot_structure(beam.geometry, sensors=[frf_ipz.Dof(11, "z")])
    >>> ax.get_xlabel()
    'Position, m'
    """
    require_type("geometry", geometry, Geometry)
    marks = StructureMarks(
        sensors=as_dofs(sensors, name="sensors"), inputs=as_dofs(inputs, name="inputs"), points=as_dofs(points)
    )
    return _draw(describe_structure(geometry, marks), ax, "the model has no nodes")


def plot_mismatch(diagnosis: Diagnosis, *, column: str = "before", ax: Axes | None = None) -> Axes:
    """Draw the misfit over what noise and tolerances explain, by FRF and band.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    column : str
        ``before`` or ``after``: of the model as it is, or with the findings.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        A map; 1 is as good as the measurement.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> ax = frf_ipz.plotting.plot_mismatch(diagnosis)
    >>> ax.get_ylabel()
    'as it is'
    """
    require_type("diagnosis", diagnosis, Diagnosis)
    picture = describe_mismatch(diagnosis)
    names = [] if picture is None else [layer.name for layer in picture.layers]
    if picture is None or column not in names:
        raise InputError(f"there is no misfit '{column}' of this diagnosis; there is {', '.join(names) or 'none'}")
    return draw_panel(picture, ax, panel=names.index(column))


def plot_ranking(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw findings and alternatives by their evidence.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Bars; the findings stand out.

    Raises
    ------
    InputError
        If there is nothing to draw.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> ax = frf_ipz.plotting.plot_ranking(diagnosis)
    >>> ax.get_xlabel()
    'Log Bayes factor over the model without it'
    """
    require_type("diagnosis", diagnosis, Diagnosis)
    return _draw(describe_ranking(diagnosis), ax, "no explanation gains any evidence")


def plot_proof(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Draw the error of the FRFs before and after, on what was fitted and on what was held out.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Bars.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> stiffness = 1e5 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    >>> dofs = ["1:x", "2:x", "3:x"]
    >>> masses = np.diag([2.0, 1.0, 1.0])
    >>> model = frf_ipz.StructuralModel.from_matrices(masses, stiffness, dofs=dofs, modal_damping=0.01)
    >>> heavier = frf_ipz.StructuralModel.from_matrices(
    ...     masses + np.diag([0.0, 0.0, 0.2]), stiffness, dofs=dofs, modal_damping=0.01
    ... )
    >>> lines = np.arange(5, 100.0, 0.5)
    >>> first, accelerance = frf_ipz.Dof(1, "x"), frf_ipz.FrfQuantity.ACCELERANCE
    >>> labels = [frf_ipz.FrfLabel(frf_ipz.parse_dof(dof), first, accelerance) for dof in dofs]
    >>> values = frf_ipz.compute_frfs(heavier, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=dofs, inputs=["1:x"], variance=np.full(values.shape, 2e-6)
    ... )
    >>> options = frf_ipz.DiagnoseOptions(effects=("added_mass",))
    >>> diagnosis = frf_ipz.diagnose(frfs, model, options=options)
    >>> ax = frf_ipz.plotting.plot_proof(diagnosis)
    >>> ax.get_ylabel()
    'Normalised FRF error, %'
    """
    require_type("diagnosis", diagnosis, Diagnosis)
    return draw_panel(describe_proof(diagnosis), ax)


def plot_law(law: LawInTime, *, ax: Axes | None = None) -> Axes:
    """Draw a record as measured, with a force law and without it; the law's force, where none was simulated.

    Parameters
    ----------
    law : LawInTime
        Of a diagnosis.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        Responses over time, or the force over the motion at its location.
    """
    require_type("law", law, LawInTime)
    return draw_panel(describe_law_response(law) or describe_law_force(law), ax)


def plot_levels(levels: LevelDependence, *, ax: Axes | None = None) -> Axes:
    """Draw the change of each mode's frequency over the level of excitation, with 95 % bars.

    Parameters
    ----------
    levels : LevelDependence
        Weak beside strong records.
    ax : Axes, optional
        Where to draw; axes of a new figure where it is left out.

    Returns
    -------
    Axes
        A line of a linear structure stays at zero.

    Raises
    ------
    InputError
        If there is nothing to draw.
    """
    require_type("levels", levels, LevelDependence)
    return _draw(describe_level_modes(levels), ax, "no mode was found at several levels")


def _draw(picture: Picture | None, ax: Axes | None, otherwise: str) -> Axes:
    if picture is None:
        raise InputError(f"{otherwise}: there is nothing to draw")
    return draw_panel(picture, ax)
