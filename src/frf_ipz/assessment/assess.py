"""The assessment of a run: every check, and the likely cause of a mismatch.

Sits after prediction and diagnosis, before export and report. A new check is one more function in `CHECKS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, TypeAlias

from frf_ipz.assessment.assessment import Assessment, Check
from frf_ipz.assessment.causes.cause import Situation
from frf_ipz.assessment.causes.columns import find_exchanged_columns, find_inverted_columns
from frf_ipz.assessment.causes.likely_cause import find_likely_cause
from frf_ipz.assessment.causes.modal_comparison import computed_modes, measured_modes
from frf_ipz.assessment.checks import agreement, counterparts, prediction, quality, shapes
from frf_ipz.errors import NumericalError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.numerics.one_thread import on_one_thread

if TYPE_CHECKING:
    from frf_ipz.assessment.assessment import LikelyCause
    from frf_ipz.assessment.causes.modal_comparison import ComputedModes, MeasuredModes
    from frf_ipz.assessment.evidence import Evidence
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import Trace
    from frf_ipz.structure import StructuralModel

Ask: TypeAlias = "Callable[[Evidence], Iterator[Check]]"
CHECKS: tuple[Ask, ...] = (
    quality.targets,
    agreement.amplitude,
    agreement.left_out_points,
    agreement.phase,
    agreement.improvement,
    agreement.own_band,
    counterparts.modes,
    counterparts.zeros,
    prediction.reference,
    prediction.band_width,
    quality.parameters,
    quality.fit,
    quality.impacts,
    quality.scale,
    quality.level,
    quality.diagnosis,
)
WITHOUT_FRFS: tuple[Ask, ...] = (
    quality.targets,
    shapes.no_frfs,
    shapes.agreement,
    counterparts.modes,
    prediction.reference,
    prediction.band_width,
    quality.parameters,
    quality.diagnosis,
)
MODES_BEYOND = 12  # of the model, besides twice the measured ones: a model that is too soft has more in the band


@on_one_thread
def assess(evidence: Evidence) -> Assessment:
    """Say whether the result of a run can be used.

    Parameters
    ----------
    evidence : Evidence
        The results of the run.

    Returns
    -------
    Assessment
        Verdict, checks and likely cause.
    """
    asked = CHECKS if evidence.frfs.n_frfs else WITHOUT_FRFS
    checks = [check for ask in asked for check in ask(evidence)]
    cause = likely_cause(
        evidence.frfs,
        evidence.fit,
        evidence.fe_model,
        explained_model=evidence.explained_model,
        impacts=evidence.impacts,
        is_recorded=evidence.is_recorded,
        test_file=evidence.test_file,
        model_file=evidence.model_file,
    )
    deviations = tuple(found for found in (evidence.point_deviation, evidence.deviation) if found is not None)
    return Assessment.of_checks(checks, cause, deviations=deviations)


def likely_cause(
    frfs: FrfSet,
    fit: ModalFit,
    fe_model: StructuralModel,
    *,
    explained_model: StructuralModel | None = None,
    impacts: tuple[Trace, ...] = (),
    is_recorded: bool,
    test_file: str,
    model_file: str,
) -> LikelyCause | None:
    """Look for a mistake that explains how measured and computed modes differ.

    Parameters
    ----------
    frfs : FrfSet
        As measured.
    fit : ModalFit
        The fitted model.
    fe_model : StructuralModel
        As the user handed it in.
    explained_model : StructuralModel, optional
        The FE model with what a diagnosis found, where that explains the measurement.
    impacts : tuple of Trace
        Forces and responses of a hammer's impacts; empty for other tests.
    is_recorded : bool
        The FRFs were estimated from columns of recordings.
    test_file, model_file : str
        Where a mistake would stand.

    Returns
    -------
    LikelyCause or None
        None where no mistake is more likely than not, and where there are no FRFs.
    """
    if not frfs.n_frfs:
        return None
    exchanged = find_exchanged_columns(impacts, frfs.labels, test_file=test_file)
    if exchanged is not None:
        return exchanged
    situation = compare_modes(
        measured_modes(fit), fe_model, test_file=test_file, model_file=model_file, is_recorded=is_recorded
    )
    if situation is None:
        return None
    explained = None if explained_model is None else _modes(explained_model, situation.measured)
    named = find_likely_cause(situation, explained)
    return find_inverted_columns(frfs, situation) if named is None and is_recorded and not impacts else named


def compare_modes(
    measured: MeasuredModes, model: StructuralModel, *, test_file: str, model_file: str, is_recorded: bool
) -> Situation | None:
    """Set the modes of an FE model beside measured ones, to look for a mistake.

    Parameters
    ----------
    measured : MeasuredModes
        Of a fit, or of a first look at the FRFs.
    model : StructuralModel
        The FE model as the user handed it in.
    test_file, model_file : str
        Names of the files that a mistake may stand in.
    is_recorded : bool
        The FRFs were estimated from columns of recordings.

    Returns
    -------
    Situation or None
        None where the model has no modes that can be computed.
    """
    computed = _modes(model, measured)
    if computed is None:
        return None
    return Situation(
        measured=measured,
        computed=computed,
        model=model,
        test_file=test_file,
        model_file=model_file,
        is_recorded=is_recorded,
    )


def _modes(model: StructuralModel, measured: MeasuredModes) -> ComputedModes | None:
    """Modes of a model that may be among the measured ones; None where they cannot be computed."""
    n_modes = min(2 * len(measured.frequency_hz) + MODES_BEYOND, model.n_modes)
    try:
        return computed_modes(solve_modes(model, n_modes=n_modes))
    except NumericalError:
        return None
