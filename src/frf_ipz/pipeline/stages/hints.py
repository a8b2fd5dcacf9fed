"""What most likely has to be corrected, where numbers of a stage end in no result."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

from frf_ipz.errors import (
    FileFormatError,
    FrfIpzError,
    IllConditionedError,
    InputError,
    NoModesError,
    NumericalError,
)
from frf_ipz.late_imports import import_late

if TYPE_CHECKING:
    from frf_ipz.assessment.assess import likely_cause
    from frf_ipz.assessment.assessment import LikelyCause
    from frf_ipz.assessment.causes.columns import find_exchanged_columns
    from frf_ipz.fe.eigen import solve_modes
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.structure import StructuralModel
else:
    likely_cause = import_late("frf_ipz.assessment.assess", "likely_cause")
    find_exchanged_columns = import_late("frf_ipz.assessment.causes.columns", "find_exchanged_columns")
    solve_modes = import_late("frf_ipz.fe.eigen", "solve_modes")

FEW_MODES = 10  # whether these can be computed tells whether a model can


@contextmanager
def naming_the_cause(
    inputs: PipelineInputs, recordings: FrfEstimate, fit: ModalFit, fe_model: StructuralModel
) -> Iterator[None]:
    """Name the likely cause where a stage fails on numbers: a wrong unit of the model is an error of the input.

    Parameters
    ----------
    inputs : PipelineInputs
        What is worked on.
    recordings : FrfEstimate
        FRFs and recordings.
    fit : ModalFit
        The fitted model.
    fe_model : StructuralModel
        The FE model.

    Yields
    ------
    None
        While the stages after the fit are run.

    Raises
    ------
    InputError
        Where there is a likely cause, or matrices of the model are at fault; else the error of the stage goes on.
    """
    try:
        yield
    except NumericalError as error:
        impacts = inputs.impacts(recordings)
        cause = likely_cause(recordings.frfs, fit, fe_model, impacts=impacts, **inputs.places_of_mistakes)
        file = inputs.model_file if cause is None and _is_at_fault(inputs, fe_model, error) else ""
        _raise_with(cause, error, inputs, file=file)


@contextmanager
def naming_the_model(inputs: PipelineInputs) -> Iterator[None]:
    """Name the model's file where its matrices are at fault: that is an error of the input.

    They are where the model cannot be computed with as its file has it, not where one cannot that was made of it.

    Parameters
    ----------
    inputs : PipelineInputs
        What is worked on.

    Yields
    ------
    None
        While something is computed with the model.

    Raises
    ------
    InputError
        Where matrices are at fault; else the error of the stage goes on.
    """
    try:
        yield
    except IllConditionedError as error:
        _raise_with(None, error, inputs, file=inputs.model_file if _is_at_fault(inputs, None, error) else "")


@contextmanager
def naming_exchanged_columns(inputs: PipelineInputs, recordings: FrfEstimate) -> Iterator[None]:
    """Say that force and response are exchanged where that leaves nothing to fit.

    Parameters
    ----------
    inputs : PipelineInputs
        What is worked on.
    recordings : FrfEstimate
        FRFs and recordings.

    Yields
    ------
    None
        While the FRFs are fitted.

    Raises
    ------
    InputError
        Where the columns are exchanged, or the FRFs leave nothing to solve; else the error of the fit goes on.
    """
    try:
        yield
    except (NoModesError, NumericalError) as error:
        test_file = inputs.places_of_mistakes["test_file"]
        cause = find_exchanged_columns(inputs.impacts(recordings), recordings.frfs.labels, test_file=test_file)
        _raise_with(cause, error, inputs, file=str(inputs.test.path))


def _is_at_fault(inputs: PipelineInputs, reduced: StructuralModel | None, error: NumericalError) -> bool:
    """Tell whether the model's file is at fault: what was reduced is what it holds, or its modes have no end either."""
    model = inputs.fe_model
    if model is None or not isinstance(error, IllConditionedError):
        return False
    if model is reduced:
        return True
    try:
        solve_modes(model, n_modes=min(FEW_MODES, model.n_modes))
    except IllConditionedError:
        return True
    return False


def _raise_with(cause: LikelyCause | None, error: FrfIpzError, inputs: PipelineInputs, *, file: str) -> NoReturn:
    """Raise an error with its likely cause, or with the file that is at fault, if one is."""
    if cause is not None:
        raise InputError(f"{inputs.source}: {error}; most likely {cause.says} ({cause.place})") from error
    if isinstance(error, IllConditionedError) and error.key:
        raise FileFormatError(inputs.source, str(error), where=f"key '{error.key}'") from error
    if isinstance(error, IllConditionedError) and file:
        raise FileFormatError(file, str(error)) from error
    raise error
