"""The whole chain in one call, from what is in memory or was read: measurement, FE model, points of interest."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from frf_ipz.arguments import as_path, require_each, require_type
from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.display import Concise
from frf_ipz.dofs import as_dofs, bind_port
from frf_ipz.errors import InputError
from frf_ipz.export.options import ExportOptions
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.frf import FrfSet
from frf_ipz.identification.options import FitOptions
from frf_ipz.ingest.campaign import VibrationTest
from frf_ipz.ingest.options import IngestOptions
from frf_ipz.input_files import Ledger, digest_file, entering
from frf_ipz.modes import ModalParameters
from frf_ipz.pipeline.config import StageOptions
from frf_ipz.pipeline.inputs import PipelineInputs, complete_model
from frf_ipz.pipeline.run import run_chain, run_in_memory
from frf_ipz.pipeline.sensors import without_sensors
from frf_ipz.progress import silent
from frf_ipz.runs.digests import digest_arrays
from frf_ipz.runs.folder import open_run
from frf_ipz.runs.results import open_results
from frf_ipz.structure import StructuralModel
from frf_ipz.updating.options import UpdateOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import AnyDof
    from frf_ipz.progress import Progress
    from frf_ipz.runs.results import Results

OPTIONS = {
    "ingest": IngestOptions,
    "fit": FitOptions,
    "diagnose": DiagnoseOptions,
    "reduce": ReduceOptions,
    "update": UpdateOptions,
    "export": ExportOptions,
}
MEASUREMENT, MODEL, REFERENCE = "measurement", "FE model", "reference"  # names of what is in memory, for digests


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Campaign(Concise):
    """A measurement, an FE model of the same structure, and the points at which no sensor can sit.

    Parameters
    ----------
    data : FrfSet, VibrationTest or ModalParameters
        What was measured.
    fe_model : StructuralModel, optional
        The FE model; without it the chain ends with the fit.
    points : sequence of Dof or str
        Points of interest, such as ``["49:+z"]``.
    name : str
        What it is called.
    effects : sequence of Effect or Law
        Effects and force laws of your own that a diagnosis looks for too.
    reference : FrfSet, optional
        FRFs at points of interest that were kept aside: the prediction is judged by them and does not use them.
    ingest, fit, diagnose, reduce, update, export : options, optional
        What is chosen for each stage; the program chooses where nothing is given: a cause is then looked for where
        model and measurement differ, for a minute at most.

    Raises
    ------
    InputError
        If there are points of interest and no FE model, or the model lacks a DOF that was measured or asked for.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=20,
    ...     left="clamped", modal_ratio=0.005,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> label = frf_ipz.FrfLabel(frf_ipz.Dof(21, "z"), frf_ipz.Dof(16, "z"), frf_ipz.FrfQuantity.ACCELERANCE)
    >>> measured = frf_ipz.compute_frfs(beam, [label], 2j * np.pi * lines)
    >>> frfs = frf_ipz.FrfSet.from_arrays(lines, measured[:, :, None], outputs=["21:+z"], inputs=["16:+z"])
    >>> frf_ipz.Campaign(frfs, beam, points=["11:+z"]).run().state_space.output_labels
    ['21:+z', '11:+z']
    """

    data: FrfSet | VibrationTest | ModalParameters
    fe_model: StructuralModel | None = None
    _: KW_ONLY
    points: Sequence[AnyDof | str] = ()
    name: str = "campaign"
    effects: Sequence[Effect | Law] = ()
    reference: FrfSet | None = None
    ingest: IngestOptions | None = None
    fit: FitOptions | None = None
    diagnose: DiagnoseOptions | None = None
    reduce: ReduceOptions | None = None
    update: UpdateOptions | None = None
    export: ExportOptions | None = None

    def __post_init__(self) -> None:
        require_type("data", self.data, FrfSet, VibrationTest, ModalParameters)
        require_type("fe_model", self.fe_model, StructuralModel, optional=True)
        require_type("reference", self.reference, FrfSet, optional=True)
        require_each("effects", self.effects, Effect, Law)
        for stage, kind in OPTIONS.items():
            require_type(stage, getattr(self, stage), kind, optional=True)
        self.inputs()

    def run(self, out: str | Path | None = None, *, until: str = "report", progress: Progress = silent) -> Results:
        """Run the chain.

        Parameters
        ----------
        out : str or Path, optional
            Folder for the tables, the page and the state space; in memory only where it is left out.
        until : str
            The last stage to run: ``ingest``, ``fit``, ``diagnose``, ``pair``, ``update``, ``predict``, ``export`` or
            ``report``.
        progress : Progress
            Called with the fraction done and what is being done.

        Returns
        -------
        Results
            FRFs, fit, pairs, updated model, prediction, state space, diagnosis.

        Raises
        ------
        InputError
            If something does not fit; the message says what to do.
        """
        inputs = self.inputs()
        if out is None:
            return run_in_memory(inputs, until=until, progress=progress)
        with open_run(as_path(out), progress=progress) as folder:
            run_chain(inputs, folder, until=until, diagnosing=None, progress=progress)
        return open_results(out)

    def _test(self) -> VibrationTest:
        if isinstance(self.data, VibrationTest):
            return self.data
        make = VibrationTest.from_modes if isinstance(self.data, ModalParameters) else VibrationTest.from_frfs
        return make(self.data, name=self.name)  # type: ignore[arg-type]

    def inputs(self) -> PipelineInputs:
        """Check that everything fits together.

        Returns
        -------
        PipelineInputs
            What the chain works on.

        Raises
        ------
        InputError
            If something does not fit.
        """
        chosen = {stage: getattr(self, stage) for stage in OPTIONS}
        options = replace(StageOptions(), **{stage: value for stage, value in chosen.items() if value is not None})
        ports = {} if self.fe_model is None else self.fe_model.port_dofs
        points = tuple(bind_port(dof, ports) for dof in as_dofs(self.points))
        test = without_sensors(self._test(), options.ingest.hide).with_ports(ports).with_forces_at(points)
        if self.fe_model is None and points:
            raise InputError("points of interest need an FE model; hand it in as the second argument")
        ledger = Ledger()
        with entering(ledger):
            digests = {str(file): digest_file(file) for file in test.files} | {MEASUREMENT: _digest_test(test)}
        if self.fe_model is not None:
            digests[MODEL] = _digest_model(self.fe_model)
        if self.reference is not None:
            digests[REFERENCE] = digest_arrays([self.reference.frequency_hz, self.reference.values])
        return PipelineInputs(
            name=self.name,
            source=f"campaign '{self.name}'",
            folder=Path(),
            options=options,
            test=test,
            fe_model=None if self.fe_model is None else complete_model(self.fe_model, test, points),
            points=points,
            effects=tuple(self.effects),
            digests=digests,
            measurement_names=(*map(str, test.files), MEASUREMENT),
            model_names=() if self.fe_model is None else (MODEL,),
            reference=self.reference,
            reference_name=REFERENCE if self.reference is not None else "",
            ledger=ledger,
        )


def _digest_test(test: VibrationTest) -> str:
    arrays = list(test.signals.values())
    if test.frfs is not None:
        arrays += [getattr(test.frfs, name) for name in ("frequency_hz", "values", "variance", "coherence", "averages")]
    if test.modes is not None:
        modes = test.modes
        stds = [values for values in (modes.frequency_std_hz, modes.damping_ratio_std) if values is not None]
        arrays += [modes.natural_frequency_hz, modes.damping_ratio, modes.shapes.real, modes.shapes.imag, *stds]
    return digest_arrays(arrays)


def _digest_model(model: StructuralModel) -> str:
    matrices = [model.mass_all, model.stiffness_all, model.damping_all, model.modal_damping, model.fixed]
    further = [model.structural_damping_all, None if model.motions is None else model.motions.matrix]
    matrices += [matrix for matrix in further if matrix is not None]
    weights = [f"{port!r} {dict(port.weights)}" for port in model.ports]
    return digest_arrays([*matrices, [str(dof) for dof in model.all_dofs], weights])
