"""What a run is to work on, checked before anything is computed: from the user's files, or from what is in memory."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from frf_ipz.dofs import AnyDof, bind_port, parse_label
from frf_ipz.errors import FileFormatError, InputError, errors_of_file, problem_of
from frf_ipz.fe.changes import with_default_damping, with_point_masses
from frf_ipz.fe.model_file import model_files, read_model
from frf_ipz.ingest.campaign_file import bind_ports, read_test
from frf_ipz.ingest.estimation.frf_files import read_frfs
from frf_ipz.input_files import Ledger, digest_file, entering
from frf_ipz.pipeline.config import StageOptions, read_pipeline, wrong_keys_of_all
from frf_ipz.pipeline.sensors import without_sensors
from frf_ipz.pipeline.shared_model import SharedModel

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.nonlinear.laws.law import Law
    from frf_ipz.dofs import PortDof
    from frf_ipz.frf import FrfSet
    from frf_ipz.ingest.campaign import VibrationTest
    from frf_ipz.ingest.frf_estimate import FrfEstimate, Trace
    from frf_ipz.pipeline.config import Pipeline
    from frf_ipz.structure import StructuralModel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PipelineInputs:
    """A test, an FE model, points of interest, and what the user chose for each stage.

    Parameters
    ----------
    name : str
        What the run is called.
    source : str
        Where it was described, for messages: the pipeline file, or the campaign.
    folder : Path
        Where paths of users' own effects start.
    options : StageOptions
        What the user chose for each stage.
    test : VibrationTest
        The test, without sensors that are hidden.
    fe_model : StructuralModel, optional
        The FE model with the sensors' known masses; None where the run ends with the fit.
    points : tuple of Dof
        Points of interest.
    effects : tuple of Effect or Law
        Effects and force laws of the user's that are looked for too.
    digests : mapping of str to str
        Digest of everything that the user handed in, by its name.
    measurement_names, model_names : tuple of str
        Those of `digests` that the FRFs and the FE model are made from.
    reference : FrfSet, optional
        FRFs that a prediction is judged by.
    reference_name : str
        Its name in `digests`.
    ledger : Ledger
        What was in each file: a stage that reads one again must find the same.
    shared : SharedModel, optional
        The FE model, where many runs have the same one.
    """

    name: str
    source: str
    folder: Path
    options: StageOptions
    test: VibrationTest
    fe_model: StructuralModel | None = None
    points: tuple[AnyDof, ...] = ()
    effects: tuple[Effect | Law, ...] = ()
    digests: Mapping[str, str] = field(default_factory=dict)
    measurement_names: tuple[str, ...] = ()
    model_names: tuple[str, ...] = ()
    reference: FrfSet | None = None
    reference_name: str = ""
    ledger: Ledger = field(default_factory=Ledger)
    shared: SharedModel | None = None

    @property
    def model_key(self) -> list[object]:
        """What the FE model was made from."""
        files = [self.digests[name] for name in self.model_names]
        return [*files, self.test.nominal_damping_ratio, sorted(self.test.sensor_masses.items())]

    @property
    def model_file(self) -> str:
        """Where the FE model is described, for messages."""
        return next(iter(self.model_names), "FE model")

    @property
    def places_of_mistakes(self) -> PlacesOfMistakes:
        """Where a mistake of the user's would stand."""
        return {
            "test_file": self.test.path.name,
            "model_file": Path(self.model_file).name,
            "is_recorded": self.test.kind not in {"frf", "modes"},
        }

    def impacts(self, estimate: FrfEstimate) -> tuple[Trace, ...]:
        """Traces of impacts: only of these it is known what force and response look like."""
        return estimate.traces if self.test.kind == "hammer" else ()


class PlacesOfMistakes(TypedDict):
    """Files in which a mistake would stand, and whether the test has columns of recordings, or names FRFs."""

    test_file: str
    model_file: str
    is_recorded: bool


def read_inputs(path: Path, *, shared: SharedModel | None = None) -> PipelineInputs:
    """Read a pipeline file and all that it names.

    Parameters
    ----------
    path : Path
        ``pipeline.toml``, or a folder that holds exactly one pipeline.
    shared : SharedModel, optional
        The FE model that it names, as it has been read for many runs; it is read here where it is left out.

    Returns
    -------
    PipelineInputs
        Ready to run.

    Raises
    ------
    InputError
        On the first thing that is wrong, and on all keys of all files that are: which file, which place, what was
        expected.
    """
    ledger = Ledger() if shared is None else shared.ledger()
    with entering(ledger):
        try:
            return _read_inputs(path, ledger, shared)
        except FileFormatError as error:
            raise wrong_keys_of_all(error, path) from None


def _read_inputs(path: Path, ledger: Ledger, shared: SharedModel | None) -> PipelineInputs:
    pipeline = read_pipeline(path)
    test = _read_test(pipeline)
    nominal = None if pipeline.model_path is None else _read_model(pipeline.model_path, shared)
    ports = {} if nominal is None else nominal.port_dofs
    points = _read_points(pipeline, ports)
    test = bind_ports(test, ports).with_forces_at(points)
    if nominal is None and points:
        raise FileFormatError(
            pipeline.path,
            "points of interest need an FE model; name it as [pipeline] model",
            where="key 'predict.points'",
        )
    fe_model = None
    if nominal is not None and pipeline.model_path is not None:
        with errors_of_file(pipeline.model_path):
            fe_model = complete_model(nominal, test, points)
    files_of_model = () if pipeline.model_path is None else model_files(pipeline.model_path)
    # what was found by other code of the user's is not what this one finds
    effects = (file for file in pipeline.file.diagnose.effect_files(pipeline.path.parent) if file.is_file())
    files_of_model = (*files_of_model, *effects)
    aside = pipeline.reference_path
    further = [file for file in (aside, test.geometry_path) if file is not None]
    files = [pipeline.path, pipeline.test_path, *test.files, *files_of_model, *further]
    return PipelineInputs(
        name=pipeline.name,
        source=str(pipeline.path),
        folder=pipeline.path.parent,
        options=pipeline.file,
        test=test,
        fe_model=fe_model,
        points=points,
        digests={str(file): digest_file(file) for file in dict.fromkeys(files)},
        measurement_names=tuple(str(file) for file in test.files),
        model_names=tuple(str(file) for file in files_of_model),
        reference=None if aside is None else _read_reference(aside, test, pipeline),
        reference_name="" if aside is None else str(aside),
        ledger=ledger,
        shared=shared,
    )


def complete_model(fe_model: StructuralModel, test: VibrationTest, points: Sequence[AnyDof]) -> StructuralModel:
    """Add to an FE model what the test knows of it: the sensors' masses, and damping where the model states none.

    Parameters
    ----------
    fe_model : StructuralModel
        As the user handed it in.
    test : VibrationTest
        The test.
    points : sequence of Dof
        Points of interest.

    Returns
    -------
    StructuralModel
        The model that measurements are held against.

    Raises
    ------
    InputError
        If it lacks a DOF of the test or a point of interest, or holds it.
    """
    for dof in (*test.output_dofs, *test.input_dofs, *points):
        try:
            fe_model.rows([dof])
        except InputError as error:
            raise InputError(f"{error}; it is needed for '{dof}' of the test or of [predict]") from None
    return with_point_masses(with_default_damping(fe_model, test.nominal_damping_ratio), test.sensor_masses)


def _read_test(pipeline: Pipeline) -> VibrationTest:
    test = read_test(pipeline.test_path)
    try:
        return without_sensors(test, pipeline.file.ingest.hide)
    except InputError as error:
        raise FileFormatError(pipeline.path, str(error), where="key 'ingest.hide'") from None


def _read_reference(path: Path, test: VibrationTest, pipeline: Pipeline) -> FrfSet:
    """Read the FRFs that a prediction is held against; their file says all itself, as no ``[[frf]]`` does."""
    try:
        return read_frfs(path, quantity=test.labels[0].quantity)
    except FileFormatError as error:
        if "[[frf]]" not in error.problem:
            raise
        problem = f"{path.name} {problem_of(error)}; a reference says itself what its FRFs connect, and their unit"
        way_out = "write it to CSV in SI with frequency_hz, output_dof, input_dof, real, imag, or leave it out"
        raise FileFormatError(pipeline.path, f"{problem}: {way_out}", where="key 'predict.reference'") from None


def _read_points(pipeline: Pipeline, ports: Mapping[PortDof, PortDof]) -> tuple[AnyDof, ...]:
    try:
        return tuple(bind_port(parse_label(text), ports) for text in pipeline.file.predict.points)
    except InputError as error:
        raise FileFormatError(pipeline.path, str(error), where="key 'predict.points'") from None


def _read_model(path: Path, shared: SharedModel | None) -> StructuralModel:
    return read_model(path) if shared is None or shared.path != path else shared.model
