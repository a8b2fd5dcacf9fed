"""What a run found: the results of all stages by their names, from memory or from a folder."""

from __future__ import annotations

from contextlib import contextmanager
from functools import cached_property
from html import escape
from importlib import import_module
from pathlib import Path
from traceback import extract_tb
from typing import TYPE_CHECKING, Any, Protocol, Self

from frf_ipz.arguments import as_path
from frf_ipz.display import PICTURES, REPORT
from frf_ipz.errors import FileFormatError, FrfIpzError, InputError, did_you_mean
from frf_ipz.late_imports import import_late
from frf_ipz.runs.folder import SupersededError, read_run
from frf_ipz.structure import StructuralModel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import control
    import pandas as pd
    from matplotlib.figure import Figure

    from frf_ipz.assessment.assessment import Assessment
    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.dofs import AnyDof
    from frf_ipz.export import frames, run_tables
    from frf_ipz.export.state_space import StateSpaceModel, to_control
    from frf_ipz.frf import FrfLabel, FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.ingest.frf_estimate import FrfEstimate
    from frf_ipz.pairing.pairs import Pairs
    from frf_ipz.prediction.prediction import Prediction
    from frf_ipz.runs.summary import summarise
    from frf_ipz.structure import Geometry, ReducedModel
    from frf_ipz.updating.updated_model import UpdatedModel
else:
    frames, run_tables = import_late("frf_ipz.export.frames"), import_late("frf_ipz.export.run_tables")
    summarise = import_late("frf_ipz.runs.summary", "summarise")
    to_control = import_late("frf_ipz.export.state_space", "to_control")


INCONSISTENT = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RecursionError)


class Store(Protocol):
    """Where results of stages are kept: a `RunFolder` or a `RunMemory`."""

    manifest: dict[str, Any]

    @property
    def name(self) -> str:
        """Where that is, for people."""

    def load(self, name: str) -> Any:  # noqa: ANN401  every stage has a result of its own type
        """Give the result of a stage, or None where it has not run.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        object
            The result.
        """

    def is_stale(self, name: str) -> bool:
        """Tell whether the result of a stage was made from something older.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        bool
            True where it is out of date.
        """


class Results:
    """Results of a run; each is None where its stage has not run.

    Parameters
    ----------
    store : Store
        Where they are kept.

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
    >>> results = frf_ipz.Campaign(frfs).run()
    >>> results.stages
    ('ingest', 'fit')
    >>> results.fit.n_modes
    3
    """

    def __init__(self, store: Store) -> None:
        self._store = store

    def __repr__(self) -> str:
        stages = ", ".join(self.stages) or "no stage"
        return f"Results of '{self.name}' ({self._store.name}): {stages}"

    @property
    def manifest(self) -> Mapping[str, Any]:
        """What ``run.json`` says: versions, digests of the inputs, options, times of the stages."""
        return self._store.manifest

    @property
    def name(self) -> str:
        """What the run is called."""
        return str(self.manifest.get("name", "")) or "run"

    @property
    def path(self) -> Path | None:
        """The folder; None for a run in memory."""
        return getattr(self._store, "path", None)

    @property
    def stages(self) -> tuple[str, ...]:
        """Stages that have run, in the order of the chain."""
        return tuple(self.manifest.get("stages", {}))

    @property
    def stale(self) -> frozenset[str]:
        """Stages whose result was made before the last change."""
        return frozenset(stage for stage in self.stages if self._store.is_stale(stage))

    def summary(self) -> str:
        """Sum up what was found.

        Returns
        -------
        str
            At most a screen of text.
        """
        with errors_of_results(self.path):
            return summarise(self)

    def to_frame(self, table: str) -> pd.DataFrame:
        """Give a table of the run.

        Parameters
        ----------
        table : str
            The name of its file without the ending, such as ``"poles"``; or another table of one of the results.

        Returns
        -------
        DataFrame
            The table.

        Raises
        ------
        InputError
            If there is no such table, or its stage has not run.
        """
        named = ("estimate", "fit", "pairs", "updated_model", "prediction", "diagnosis", "assessment")
        results = [getattr(self, name) for name in named]
        tables = {name: result for result in results if result is not None for name in frames.FRAMES[type(result)]}
        if table not in tables:
            raise InputError(f"{self.name} has no table '{table}'; {did_you_mean(table, list(tables))}")
        if table == "pairs" and self.pairs is not None and self.updated_model is not None:
            return frames.as_frame(run_tables.pair_table(self.pairs, self.updated_model.after))
        frame: pd.DataFrame = tables[table].to_frame(table)
        return frame

    def plot(self, picture: str) -> Figure:
        """Draw a picture of the run, as ``frf-ipz plot`` does.

        Parameters
        ----------
        picture : str
            Its name, such as ``"prediction"``.

        Returns
        -------
        Figure
            Of Matplotlib.

        Raises
        ------
        InputError
            If there is no such picture, or its stage has not run.
        """
        with errors_of_results(self.path):
            figure: Figure = import_module(PICTURES).plot_run(self, picture)
        return figure

    def write_report(self, path: str | Path) -> None:
        """Write one page with all that the run holds.

        Parameters
        ----------
        path : str or Path
            File to write, such as ``"report.html"``.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        try:
            with errors_of_results(self.path):
                import_module(REPORT).write_report(self, as_path(path))
        except OSError as error:
            raise InputError(f"{path}: the report cannot be written: {error.strerror}") from None

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"

    @cached_property
    def estimate(self) -> FrfEstimate | None:
        """FRFs with the table of records that they were made from."""
        return self._load("ingest")  # type: ignore[no-any-return]

    @property
    def frfs(self) -> FrfSet | None:
        """The measured FRFs; None for a test of modes, which has none."""
        return None if self.estimate is None or self.estimate.modes is not None else self.estimate.frfs

    @cached_property
    def fit(self) -> ModalFit | None:
        """Poles, residues and zeros with their covariance."""
        return self._load("fit")  # type: ignore[no-any-return]

    @cached_property
    def geometry(self) -> Geometry | None:
        """Where the nodes of the FE model are; without one, those of the test, where it says so."""
        model = self._load("model")
        return model.geometry if isinstance(model, StructuralModel) else model

    @cached_property
    def reduced_model(self) -> ReducedModel | None:
        """The FE model in a few physical DOFs."""
        return self._load("reduce")  # type: ignore[no-any-return]

    @cached_property
    def pairs(self) -> Pairs | None:
        """Measured poles and zeros against those of the model: what the update aimed at, where there is one."""
        updated = self.updated_model
        return self._load("pair") if updated is None or updated.pairs is None else updated.pairs

    @cached_property
    def updated_model(self) -> UpdatedModel | None:
        """The reduced model after updating."""
        return self._load("update")  # type: ignore[no-any-return]

    @cached_property
    def prediction(self) -> Prediction | None:
        """FRFs at the points of interest with their 90 % band."""
        return self._load("predict")  # type: ignore[no-any-return]

    @cached_property
    def with_causes(self) -> Prediction | None:
        """FRFs at the points of interest of a model that has what the diagnosis found, where they can be judged."""
        return None if "causes" in self.stale else self._load("causes")

    @cached_property
    def reference(self) -> FrfSet | None:
        """Measured FRFs at points of interest that were kept aside."""
        return self._load("reference")  # type: ignore[no-any-return]

    @cached_property
    def assessment(self) -> Assessment | None:
        """Whether the result can be used: verdict, checks, likely cause; None where that was said of older results."""
        return None if "assess" in self.stale else self._load("assess")

    @cached_property
    def state_space_arrays(self) -> StateSpaceModel | None:
        """The state space as arrays with names and units."""
        return self._load("export")  # type: ignore[no-any-return]

    @cached_property
    def state_space(self) -> control.StateSpace | None:
        """The state space for python-control, with the names of inputs, outputs and states."""
        return None if self.state_space_arrays is None else to_control(self.state_space_arrays)

    @cached_property
    def diagnosis(self) -> Diagnosis | None:
        """What the FE model left out."""
        return self._load("diagnose")  # type: ignore[no-any-return]

    @cached_property
    def level_dependence(self) -> LevelDependence | None:
        """Modes and FRFs at weak beside strong levels of excitation."""
        return self._load("levels")  # type: ignore[no-any-return]

    @property
    def labels(self) -> tuple[FrfLabel, ...]:
        """What each measured FRF connects."""
        return () if self.frfs is None else self.frfs.labels

    @property
    def points(self) -> tuple[AnyDof, ...]:
        """The points of interest."""
        return () if self.prediction is None else tuple(dict.fromkeys(x.output_dof for x in self.prediction.labels))

    @property
    def band_hz(self) -> tuple[float, float]:
        """The band of the fit; without a fit that of the measurement, and (0, 1) without either."""
        if self.fit is not None:
            return self.fit.band_hz
        if self.frfs is not None:
            return float(self.frfs.frequency_hz[0]), float(self.frfs.frequency_hz[-1])
        return 0.0, 1.0

    def load(self) -> Self:
        """Read all results now; else each is read when it is first used.

        Returns
        -------
        Results
            The same object.

        Raises
        ------
        FileFormatError
            If a file is damaged.
        """
        names = [name for name, item in vars(type(self)).items() if isinstance(item, cached_property)]
        read = [name for name in names if name in vars(self)]
        while True:
            try:
                for name in set(names) - {"state_space"}:
                    getattr(self, name)
            except SupersededError:
                if read or self.path is None:  # the caller may hold some of the old ones
                    raise
                for name in names:
                    vars(self).pop(name, None)
                self._store = read_run(self.path)
            else:
                return self

    def _load(self, stage: str) -> Any:  # noqa: ANN401  every stage has a result of its own type
        return self._store.load(stage) if stage in self.stages else None


@contextmanager
def errors_of_results(folder: Path | None) -> Iterator[None]:
    """Say that results of a folder cannot be shown, where they do not fit together.

    What a folder holds may come from anybody. Each value is what it should be once it is read, but nothing makes
    sure that a table has the rows that another one points at.

    Parameters
    ----------
    folder : Path, optional
        The folder; None for a run in memory, whose errors stay what they are.

    Yields
    ------
    None
        While they are shown.

    Raises
    ------
    FileFormatError
        In the place of an error that is none of this package's.
    """
    try:
        yield
    except FrfIpzError:
        raise
    except INCONSISTENT as error:
        if folder is None:
            raise
        place = extract_tb(error.__traceback__)[-1]
        raise FileFormatError(
            folder,
            f"its results do not fit together ({error!r:.100} in {Path(place.filename).name}, line {place.lineno}): "
            "they are damaged, or the program has a fault; run again, and report it where that does not help",
        ) from error


def open_results(path: str | Path) -> Results:
    """Open the results of a run.

    Parameters
    ----------
    path : str or Path
        Its folder.

    Returns
    -------
    Results
        Read when they are asked for.

    Raises
    ------
    InputError
        If no run has been made there, or it was made by a version whose results cannot be read.

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
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     _ = frf_ipz.Campaign(frfs).run(Path(folder) / "results", until="fit")
    ...     frf_ipz.open_results(Path(folder) / "results").stages
    ('ingest', 'fit')
    """
    return Results(read_run(as_path(path)))
