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
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.structure import StructuralModel
else:
    likely_cause = import_late("frf_ipz.assessment.assess", "likely_cause")
    find_exchanged_columns = import_late("frf_ipz.assessment.causes.columns", "find_exchanged_columns")


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
        _raise_with(cause, error, inputs, file=inputs.model_file)


@contextmanager
def naming_the_model(inputs: PipelineInputs) -> Iterator[None]:
    """Name the model's file where its matrices are at fault: that is an error of the input.

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
        Where matrices are at fault.
    """
    try:
        yield
    except IllConditionedError as error:
        _raise_with(None, error, inputs, file=inputs.model_file)


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


def _raise_with(cause: LikelyCause | None, error: FrfIpzError, inputs: PipelineInputs, *, file: str) -> NoReturn:
    """Raise an error with its likely cause, or with the file whose matrices are at fault."""
    if cause is not None:
        raise InputError(f"{inputs.source}: {error}; most likely {cause.says} ({cause.place})") from error
    if not isinstance(error, IllConditionedError):
        raise error
    if error.key:
        raise FileFormatError(inputs.source, str(error), where=f"key '{error.key}'") from error
    raise FileFormatError(file, str(error)) from error
