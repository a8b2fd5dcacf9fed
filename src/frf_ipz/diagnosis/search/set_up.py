"""Lays out everything that a search works with."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.catalogue.model_context import ModelContext
from frf_ipz.diagnosis.measured.transfer_functions import Whitening, make_whitening, select_points
from frf_ipz.diagnosis.physics.basis import make_basis
from frf_ipz.diagnosis.physics.change import NOTHING
from frf_ipz.diagnosis.physics.layout import lay_out
from frf_ipz.diagnosis.physics.modified import modify
from frf_ipz.diagnosis.physics.nuisance import make_nuisance
from frf_ipz.diagnosis.physics.response import respond, rows_of, scatter
from frf_ipz.diagnosis.search.fit import Data
from frf_ipz.diagnosis.search.inference_problem import InferenceProblem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.measured.data_split import DataSplit
    from frf_ipz.diagnosis.measured.transfer_functions import TransferFunctions
    from frf_ipz.diagnosis.options import DiagnoseOptions
    from frf_ipz.diagnosis.physics.basis import Basis
    from frf_ipz.diagnosis.physics.layout import Layout
    from frf_ipz.diagnosis.physics.nuisance import Nuisance
    from frf_ipz.structure import StructuralModel

MANY_POINTS = 120  # of a contour: every other one is enough for first steps
FEW_POINTS = 110  # of a contour: what a first look at small effects needs
EARLY_FLOOR = 8.0  # times the model's errors: first steps see past narrow peaks


def set_up(
    model: StructuralModel,
    source: DataSplit,
    band_hz: tuple[float, float],
    options: DiagnoseOptions,
    effects: Mapping[str, Effect],
    *,
    free_gains: str = "none",
) -> InferenceProblem:
    """Bring model and measurement together.

    Parameters
    ----------
    model : StructuralModel
        The nominal model.
    source : DataSplit
        What was measured.
    band_hz : pair of float
        Hz.
    options : DiagnoseOptions
        Tolerances.
    effects : mapping of str to Effect
        What is looked for.
    free_gains : str
        ``none``, ``common`` or ``per_channel``: gains that nobody knows.

    Returns
    -------
    InferenceProblem
        Ready for a search.

    Raises
    ------
    InputError
        If the model lacks a DOF that was measured.
    """
    layout = lay_out(source.training.labels)
    places = [model.place(dof) for dof in (*(dof for _, dof in layout.outputs), *layout.inputs)]
    basis = make_basis(model, 2 * np.pi * band_hz[1], places)
    nuisance = make_nuisance(basis, layout, options)
    coarse, middle = source.coarse, source.middle
    if free_gains != "none":
        coarse, middle = (_scaled(one, basis, layout, nuisance, free_gains) for one in (coarse, middle))
    n_points = len(source.training.s)
    half = select_points(source.training, np.arange(0, n_points, 2 if n_points > MANY_POINTS else 1))
    few = select_points(source.training, np.arange(0, n_points, -(-n_points // FEW_POINTS)))
    specimen = ModelContext(basis=basis, layout=layout, band_hz=band_hz, contour=source.coarse.s, options=options)
    early = with_errors(half, options, free_gains=free_gains, floor=EARLY_FLOOR)
    return InferenceProblem(
        specimen=specimen,
        nuisance=nuisance,
        effects=effects,
        coarse=coarse,
        middle=middle,
        data=with_errors(source.training, options, free_gains=free_gains),
        early=replace(early, is_bounded=False),
        thin=with_errors(few, options, free_gains=free_gains),
        kind=source.kind,
    )


def with_errors(
    measured: TransferFunctions, options: DiagnoseOptions, *, free_gains: str = "none", floor: float = 1.0
) -> Data:
    """Put tolerances beside measurements.

    Parameters
    ----------
    measured : TransferFunctions
        Transfer functions.
    options : DiagnoseOptions
        Tolerances.
    free_gains : str
        As for `set_up`.
    floor : float
        Factor of the model's errors.

    Returns
    -------
    Data
        To fit to.
    """
    whitening = make_whitening(
        measured,
        tolerance=options.stiffness_tolerance,
        floor=floor,
    )
    return Data(measured=measured, whitening=whitening, free_gains=free_gains)


def _scaled(
    measured: TransferFunctions, basis: Basis, layout: Layout, nuisance: Nuisance, free_gains: str
) -> TransferFunctions:
    """Bring measured FRFs of unknown scale to the scale of the nominal model."""
    unknowns = nuisance.unpack(np.zeros(nuisance.size))
    modes = scatter(basis, modify(basis, NOTHING), rows_of(basis, layout, NOTHING, nuisance), unknowns)
    nominal = respond(modes, NOTHING, layout, unknowns, measured.s, basis)
    whitening = Whitening(factors=np.zeros((0, 0, 0), complex), blocks=())
    gains = Data(measured=measured, whitening=whitening, free_gains=free_gains).gains(nominal)
    size = np.abs(gains)
    return replace(
        measured,
        values=measured.values / gains,
        size=measured.size / size,
        covariance=measured.covariance / size[:, None, None] ** 2,
    )
