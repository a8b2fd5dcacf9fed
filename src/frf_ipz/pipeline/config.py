"""``pipeline.toml``: which test, which model, and what the user chose for each stage."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.errors import InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.fe.model_file import model_files
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign_file import read_test_keys
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.pipeline.pipeline_folder import find_pipeline
from frf_ipz.prediction.options import PredictOptions
from frf_ipz.toml_files import STRICT, error_of_all, named_files, read_toml
from frf_ipz.updating.options import UpdateOptions

if TYPE_CHECKING:
    from collections.abc import Callable

    from frf_ipz.errors import FileFormatError


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineSection:
    """``[pipeline]``: the only section that must be there.

    Parameters
    ----------
    name : str
        What the run is called.
    test : str
        Path of test.toml, relative to the pipeline file.
    model : str, optional
        Path of model.toml; without it the run ends with the fit.
    """

    __pydantic_config__ = STRICT

    name: str = ""
    test: str
    model: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StageOptions:
    """What the user chose for each stage.

    Parameters
    ----------
    ingest, fit, diagnose, reduce, update, predict, export : options
        One a stage.
    """

    __pydantic_config__ = STRICT

    ingest: IngestOptions = field(default_factory=IngestOptions)
    fit: FitOptions = field(default_factory=FitOptions)
    diagnose: DiagnoseOptions = field(default_factory=DiagnoseOptions)
    reduce: ReduceOptions = field(default_factory=ReduceOptions)
    update: UpdateOptions = field(default_factory=UpdateOptions)
    predict: PredictOptions = field(default_factory=PredictOptions)
    export: ExportOptions = field(default_factory=ExportOptions)


@dataclass(frozen=True, slots=True, kw_only=True)
class PipelineFile(StageOptions):
    """All sections of ``pipeline.toml``.

    Parameters
    ----------
    pipeline : PipelineSection
        Test and model.
    ingest, fit, diagnose, reduce, update, predict, export : options
        What the user chose for each stage.
    """

    __pydantic_config__ = STRICT

    pipeline: PipelineSection


@dataclass(frozen=True, slots=True, kw_only=True)
class Pipeline:
    """A pipeline file with its paths resolved.

    Parameters
    ----------
    path, test_path : Path
        The pipeline file, and the test it names.
    model_path : Path, optional
        None where the run ends with the fit.
    reference_path : Path, optional
        FRFs that a prediction is judged by.
    file : PipelineFile
        What it says.
    """

    path: Path
    test_path: Path
    model_path: Path | None
    reference_path: Path | None
    file: PipelineFile

    @property
    def name(self) -> str:
        """What the run is called; the file's name where it says nothing."""
        return self.file.pipeline.name or self.path.stem


def wrong_keys_of_all(error: FileFormatError, path: Path) -> InputError:
    """Say what is wrong with the keys of a pipeline, of its test and of its model at once.

    Parameters
    ----------
    error : FileFormatError
        What was met first.
    path : Path
        The pipeline file, or a folder that holds exactly one.

    Returns
    -------
    InputError
        The error itself, unless there is one of another file too.
    """
    checks: list[Callable[[], object]] = [partial(read_pipeline, path)]
    readers = {"test": read_test_keys, "model": model_files}
    with suppress(InputError):
        files = named_files(find_pipeline(path), "pipeline", readers)
        checks += [partial(readers[key], file) for key, file in files.items()]
    return error_of_all(error, checks)


def read_pipeline(path: Path) -> Pipeline:
    """Read a pipeline file.

    Parameters
    ----------
    path : Path
        The file, or a folder that holds exactly one.

    Returns
    -------
    Pipeline
        Checked, with paths relative to the file resolved.

    Raises
    ------
    InputError
        If the file, or a key in it, is wrong, or a folder holds none or several.
    """
    path = find_pipeline(path)
    file = read_toml(path, PipelineFile, required="pipeline")
    folder = path.resolve().parent
    model, reference = file.pipeline.model, file.predict.reference
    return Pipeline(
        path=path.resolve(),
        test_path=folder / file.pipeline.test,
        model_path=None if model is None else folder / model,
        reference_path=None if reference is None else folder / reference,
        file=file,
    )
