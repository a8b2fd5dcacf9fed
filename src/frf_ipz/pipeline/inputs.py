"""What a command is to work on: the files of the user, read and checked before anything is computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from frf_ipz.dofs import Dof, parse_dof
from frf_ipz.errors import FileFormatError, InputError
from frf_ipz.fe.changes import with_default_damping, with_point_masses
from frf_ipz.fe.model_file import model_files, read_model
from frf_ipz.ingest.campaign import VibrationTest
from frf_ipz.ingest.campaign_file import read_test
from frf_ipz.pipeline.config import Pipeline, read_pipeline
from frf_ipz.pipeline.reference import read_reference
from frf_ipz.pipeline.sensors import without_sensors
from frf_ipz.runs.digests import digest_file

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from frf_ipz.frf import FrfSet
    from frf_ipz.structure import StructuralModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PipelineInputs:
    """A pipeline with its test and model.

    Parameters
    ----------
    pipeline : Pipeline
        The pipeline file.
    test : VibrationTest
        The test.
    model : StructuralModel, optional
        The FE model with the sensors' known masses; None where the run ends with the fit.
    points : tuple of Dof
        Points of interest.
    digests : mapping of str to str
        Digest of every file that the user handed in.
    model_files : tuple of Path
        Those that the model was read from.
    reference : FrfSet, optional
        FRFs that a prediction is judged by.
    """

    pipeline: Pipeline
    test: VibrationTest
    model: StructuralModel | None
    points: tuple[Dof, ...]
    digests: Mapping[str, str]
    model_files: tuple[Path, ...] = ()
    reference: FrfSet | None = None

    @property
    def model_key(self) -> list[object]:
        """What the FE model was made from."""
        files = [self.digests[str(file)] for file in self.model_files]
        return [*files, self.test.nominal_damping_ratio, sorted(self.test.sensor_masses.items())]


def read_inputs(path: Path) -> PipelineInputs:
    """Read a pipeline file and all that it names.

    Parameters
    ----------
    path : Path
        ``pipeline.toml``.

    Returns
    -------
    PipelineInputs
        Ready to run.

    Raises
    ------
    InputError
        On the first thing that is wrong: which file, which place, what was expected.
    """
    pipeline = read_pipeline(path)
    test = _test(pipeline)
    points = _points(pipeline)
    model = None if pipeline.model_path is None else _model(pipeline.model_path, test, points)
    if model is None and points:
        raise FileFormatError(
            pipeline.path,
            "points of interest need an FE model; name it as [pipeline] model",
            where="key 'predict.points'",
        )
    of_model = () if pipeline.model_path is None else model_files(pipeline.model_path)
    aside = pipeline.reference_path
    reference = None if aside is None else read_reference(aside, test.labels[0].quantity)
    files = [pipeline.path, pipeline.test_path, *test.files, *of_model, *([] if aside is None else [aside])]
    return PipelineInputs(
        pipeline=pipeline,
        test=test,
        model=model,
        points=points,
        digests={str(file): digest_file(file) for file in dict.fromkeys(files)},
        model_files=of_model,
        reference=reference,
    )


def _test(pipeline: Pipeline) -> VibrationTest:
    test = read_test(pipeline.test_path)
    try:
        return without_sensors(test, pipeline.file.ingest.hide)
    except InputError as error:
        raise FileFormatError(pipeline.path, str(error), where="key 'ingest.hide'") from None


def _points(pipeline: Pipeline) -> tuple[Dof, ...]:
    try:
        return tuple(parse_dof(text) for text in pipeline.file.predict.points)
    except InputError as error:
        raise FileFormatError(pipeline.path, str(error), where="key 'predict.points'") from None


def _model(path: Path, test: VibrationTest, points: tuple[Dof, ...]) -> StructuralModel:
    model = read_model(path)
    for dof in (*test.output_dofs, *test.input_dofs, *points):
        try:
            model.index(dof)
        except InputError as error:
            raise FileFormatError(path, f"{error}; it is needed for '{dof}' of the test or of [predict]") from None
    return with_point_masses(with_default_damping(model, test.nominal_damping_ratio), test.sensor_masses)
