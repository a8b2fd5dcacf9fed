"""What every stage of the chain works with: the inputs, the run's folder, and the keys of the stages before it."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from frf_ipz.errors import IllConditionedError, NumericalError, errors_of_arithmetic
from frf_ipz.input_files import entering
from frf_ipz.runs.digests import digest
from frf_ipz.runs.software import software

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from frf_ipz.ingest.recording_files import RecordingFiles
    from frf_ipz.pipeline.inputs import PipelineInputs
    from frf_ipz.progress import Progress
    from frf_ipz.runs.folder import RunFolder, Writers
    from frf_ipz.runs.memory import RunMemory

    RunStore: TypeAlias = RunFolder | RunMemory

Result = TypeVar("Result")

# What each stage's result is made from, so that what rests on something older can be marked as stale.
NEEDS = {
    "fit": ("ingest",),
    "diagnose": ("ingest",),
    "levels": ("ingest", "fit"),
    "reduce": ("fit",),
    "pair": ("fit", "reduce"),
    "update": ("pair",),
    "predict": ("update",),
    "causes": ("predict", "diagnose", "reference"),
    "assess": ("predict", "diagnose", "reference", "causes"),
    "export": ("update",),
    "files": ("fit",),
}

OF_MODEL = "check the units and sizes of the model (masses, springs, lengths)"
OF_TEST = "look at the FRFs, and leave out lines that hold no signal ([fit] band_hz, exclude_hz)"
OF_UPDATE = (
    "look at what is paired with what (frf-ipz pair), and leave out of [fit] band_hz what no mode of the model is"
)

# What each stage tries, and what to do where its numbers leave double precision.
TRIES = {
    "ingest": ("to estimate FRFs from what was recorded", "look at the recordings, and leave out the wrong ones"),
    "fit": ("to fit poles and zeros to the measured FRFs", OF_TEST),
    "levels": ("to compare FRFs at several levels", OF_TEST),
    "diagnose": ("to say what the model left out", '[diagnose] run = "never" does without'),
    "model": ("to place the nodes of the model", OF_MODEL),
    "reduce": ("to reduce the model", OF_MODEL),
    "pair": ("to pair measured with computed poles and zeros", f"{OF_MODEL} and of what was measured"),
    "update": ("to bring the model to the measured poles and zeros", OF_UPDATE),
    "predict": ("to predict FRFs with the updated model", OF_UPDATE),
    "causes": ("to update a model that was corrected by the diagnosis", '[diagnose] run = "never" does without'),
    "assess": ("to judge the results", OF_UPDATE),
    "export": ("to write the updated model in states", OF_UPDATE),
    "files": ("to write files of other software", OF_TEST),
    "report": ("to write the page", OF_TEST),
}
OF_INPUTS = ("ingest", "fit", "levels", "diagnose", "model", "reduce")  # whose matrices are those of the user's files


@contextmanager
def errors_of_stage(name: str) -> Iterator[None]:
    """Say what a stage tried where its numbers leave double precision.

    Parameters
    ----------
    name : str
        The stage.

    Yields
    ------
    None
        While it is run.

    Raises
    ------
    IllConditionedError
        In a stage that works on what the user's files hold, or where a key is to be changed.
    NumericalError
        In one that works on what the stages before it have made: no file of the user's is at fault by itself.

    Examples
    --------
    >>> try:
    ...     with errors_of_stage("assess"):
    ...         raise FloatingPointError
    ... except NumericalError as error:
    ...     print(str(error).partition(";")[0])
    the stage 'assess' tried to judge the results: numbers lie too many decades apart for double precision
    """
    tried, advice = TRIES.get(name, ("to compute", OF_MODEL))
    what = f"the stage '{name}' tried {tried}"
    try:
        with errors_of_arithmetic(what, advice=advice):
            yield
    except IllConditionedError as error:
        if name in OF_INPUTS or error.key:
            raise
        problem = str(error).partition(";")[0].removeprefix(f"{what}: ")  # a file is not what has to be corrected
        raise NumericalError(f"{what}: {problem}; {advice}") from error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageRunner:
    """What every stage needs: the inputs, the folder, and the keys of the stages before it.

    Parameters
    ----------
    inputs : PipelineInputs
        What to work on.
    recordings : RecordingFiles
        Those of the test: what one stage has read and found in them, the others need not read and find again.
    store : RunFolder or RunMemory
        Where results are kept.
    progress : Progress
        Called with the fraction done and what is being done.
    keys : dict of str to str
        Key of each stage that is done.
    """

    inputs: PipelineInputs
    recordings: RecordingFiles
    store: RunStore
    progress: Progress
    keys: dict[str, str] = field(default_factory=dict)

    def stage(
        self,
        name: str,
        depends: Mapping[str, object],
        compute: Callable[[Progress], Result],
        files: Callable[[Result], Writers] = lambda _: {},
    ) -> Result:
        """Run a stage, or take its result from the folder.

        Parameters
        ----------
        name : str
            The stage.
        depends : mapping
            What the result depends on.
        compute : callable
            Gives the result; takes a Progress.
        files : callable
            Gives what writes each file that users read, by name.

        Returns
        -------
        object
            The result.
        """
        key = self.make_key(name, depends)
        with errors_of_stage(name):
            result = self.store.stage(name, key, lambda: self._compute(name, compute), files)
        if name in self.store.computed:
            self.store.mark_stale(dependents(name))
        return result

    def _compute(self, name: str, compute: Callable[[Progress], Result]) -> Result:
        with entering(self.inputs.ledger):  # the key says what was in the files that are read here
            return compute(self.stage_progress(name))

    def make_key(self, name: str, depends: Mapping[str, object]) -> str:
        """Make the key of a stage, and keep it for the stages after it.

        Parameters
        ----------
        name : str
            The stage.
        depends : mapping
            What its result depends on.

        Returns
        -------
        str
            The key.
        """
        self.keys[name] = _key(name, depends)
        return self.keys[name]

    def holds(self, name: str, depends: Mapping[str, object]) -> bool:
        """Tell whether the folder has the result of a stage as it would be computed.

        Parameters
        ----------
        name : str
            The stage.
        depends : mapping
            What its result depends on.

        Returns
        -------
        bool
            True if the keys agree.
        """
        return bool(self.store.manifest.get("stages", {}).get(name, {}).get("key") == _key(name, depends))

    def stage_progress(self, name: str) -> Progress:
        """Give the progress of one stage, with its name before what it says.

        Parameters
        ----------
        name : str
            The stage.

        Returns
        -------
        Progress
            To hand to the stage.
        """

        def report_stage(fraction: float, text: str) -> None:
            self.progress(fraction, f"{name}: {text}" if text else name)

        report_stage(0.0, "")
        return report_stage

    def after(self, *names: str) -> list[str]:
        """Give the keys of earlier stages.

        Parameters
        ----------
        *names : str
            The stages.

        Returns
        -------
        list of str
            Their keys.
        """
        return [self.keys[name] for name in names]


def _key(name: str, depends: Mapping[str, object]) -> str:
    return digest({"stage": name, "software": software(), **depends})


def dependents(name: str) -> list[str]:
    """Give all stages whose results rest on that of a stage.

    Parameters
    ----------
    name : str
        The stage.

    Returns
    -------
    list of str
        In the order of the chain.

    Examples
    --------
    >>> dependents("update")
    ['predict', 'causes', 'assess', 'export']
    """
    stale = {name}
    for stage, needs in NEEDS.items():
        if stale & set(needs):
            stale.add(stage)
    return [stage for stage in NEEDS if stage in stale - {name}]
