"""The stage that says what the model left out, and what the others need to know of it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Literal, TypeAlias

from frf_ipz.diagnosis.deadline import Deadline
from frf_ipz.diagnosis.effect_selection import EffectCatalogue
from frf_ipz.frf import FrfSet
from frf_ipz.ingest.estimation.frf_files import read_frf_levels
from frf_ipz.input_files import entering
from frf_ipz.late_imports import import_late
from frf_ipz.output_files import write_text

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.diagnosis.catalogue.effect import Effect
    from frf_ipz.diagnosis.measured.levels import LevelDependence
    from frf_ipz.diagnosis.result import Diagnosis
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pipeline.stage_runner import StageRunner
    from frf_ipz.progress import Progress
    from frf_ipz.structure import StructuralModel

    _Run: TypeAlias = Literal["auto", "always"]
    from frf_ipz.diagnosis.apply import correct_frfs, correct_model
    from frf_ipz.diagnosis.diagnose import find_causes
    from frf_ipz.diagnosis.measured.levels import compare_frf_levels, compare_levels
    from frf_ipz.diagnosis.observations import observe_from
    from frf_ipz.pipeline.stages.hints import naming_the_model
else:
    correct_frfs = import_late("frf_ipz.diagnosis.apply", "correct_frfs")
    correct_model = import_late("frf_ipz.diagnosis.apply", "correct_model")
    find_causes = import_late("frf_ipz.diagnosis.diagnose", "find_causes")
    compare_frf_levels = import_late("frf_ipz.diagnosis.measured.levels", "compare_frf_levels")
    compare_levels = import_late("frf_ipz.diagnosis.measured.levels", "compare_levels")
    observe_from = import_late("frf_ipz.diagnosis.observations", "observe_from")
    naming_the_model = import_late("frf_ipz.pipeline.stages.hints", "naming_the_model")

STAGES = ("diagnose", "levels")
RUN_SECONDS = 60.0  # wall time of a search in a run, where the user states none


def diagnose(runner: StageRunner, model: StructuralModel, frfs: FrfSet, *, is_asked: bool) -> Diagnosis:
    """Say what the model left out.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    model : StructuralModel
        The FE model.
    frfs : FrfSet
        The measured FRFs.
    is_asked : bool
        A diagnosis is what was asked for: it takes its time, and searches whatever the misfit.

    Returns
    -------
    Diagnosis
        The verdict and what it rests on.

    Raises
    ------
    InputError
        If the model cannot be computed with.
    """
    inputs = runner.inputs
    options = inputs.options.diagnose
    ingest_options = inputs.options.ingest
    run, seconds = _limits(runner, is_asked=is_asked)

    def compute(progress: Progress) -> Diagnosis:
        words = _Words(progress=progress)
        deadline = Deadline(seconds=seconds, at_check=words.repeat)
        observations = observe_from(runner.recordings, ingest=ingest_options, frfs=frfs, fit=inputs.options.fit)
        return find_causes(
            model,
            observations,
            EffectCatalogue(options=options, folder=inputs.folder, own=inputs.effects),
            deadline=deadline,
            only_where_they_differ=run == "auto",
            progress=words,
        )

    with naming_the_model(inputs):
        return runner.stage(
            "diagnose",
            _rests_on(runner, run, seconds),
            compute,
            lambda result: {"diagnosis.json": partial(_write_json, result.to_json())},
        )


@dataclass(kw_only=True, eq=False)
class _Words:
    """The last words of a search, said again between its hypotheses, so that whoever listens can end it there."""

    progress: Progress
    fraction: float = 0.0
    text: str = ""

    def __call__(self, fraction: float, text: str) -> None:
        self.fraction, self.text = fraction, text
        self.repeat()

    def repeat(self) -> None:
        self.progress(self.fraction, self.text)


def is_known(runner: StageRunner) -> bool:
    """Tell whether the folder holds a diagnosis of these very inputs, so that `diagnose` need not search.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.

    Returns
    -------
    bool
        True if it does.
    """
    return runner.holds("diagnose", _rests_on(runner, *_limits(runner, is_asked=False)))


def _limits(runner: StageRunner, *, is_asked: bool) -> tuple[_Run, float | None]:
    """Give where a search is made, and in which time; a run takes over what the verb has found in any time."""
    options = runner.inputs.options.diagnose
    if is_asked or runner.holds("diagnose", _rests_on(runner, "always", options.seconds)):
        return "always", options.seconds
    seconds = RUN_SECONDS if options.seconds is None else options.seconds
    return ("auto" if options.run == "auto" else "always"), seconds


def _rests_on(runner: StageRunner, run: _Run, seconds: float | None) -> dict[str, object]:
    """Give the key: what a limit of time has cut is another result; whether it is applied is no matter."""
    inputs = runner.inputs
    return {
        "options": asdict(replace(inputs.options.diagnose, apply=False, run=run, seconds=seconds)),
        "effects": [repr(type(effect)) for effect in inputs.effects],
        "model": inputs.model_key,
        "after": runner.after("ingest"),
        "fit": [inputs.options.fit.band_hz, inputs.options.fit.exclude_hz],
    }


def levels(runner: StageRunner, fit: ModalFit, frfs: FrfSet) -> LevelDependence:
    """Compare weak records with strong ones.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    fit : ModalFit
        The fitted model.
    frfs : FrfSet
        The measured FRFs.

    Returns
    -------
    LevelDependence
        Empty where there is one level only.
    """
    options, test = runner.inputs.options, runner.inputs.test

    def compare(_: Progress) -> LevelDependence:
        if test.kind == "frf":
            return compare_frf_levels(read_frf_levels(test), fit)
        return compare_levels(observe_from(runner.recordings, ingest=options.ingest, frfs=frfs, fit=options.fit), fit)

    return runner.stage("levels", {"after": runner.after("ingest", "fit")}, compare)


def apply_diagnosis(
    runner: StageRunner, model: StructuralModel, frfs: FrfSet, diagnosis: Diagnosis
) -> tuple[StructuralModel, FrfSet]:
    """Put what was found missing into the model, and take what was wrong in the measuring chain off the FRFs.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.
    model : StructuralModel
        The FE model.
    frfs : FrfSet
        The measured FRFs.
    diagnosis : Diagnosis
        What was found.

    Returns
    -------
    model : StructuralModel
        The corrected model.
    frfs : FrfSet
        The corrected FRFs.
    """
    effects = effects_of(runner)
    return correct_model(diagnosis, model, effects=effects), correct_frfs(frfs, diagnosis, effects=effects)


def effects_of(runner: StageRunner) -> dict[str, Effect]:
    """Give the effects that were looked for, users' own among them.

    Parameters
    ----------
    runner : StageRunner
        Inputs, folder and keys of the earlier stages.

    Returns
    -------
    dict of str to Effect
        By name.
    """
    options = runner.inputs.options.diagnose
    with entering(runner.inputs.ledger):
        return EffectCatalogue(options=options, folder=runner.inputs.folder, own=runner.inputs.effects).effects()


def corrections(diagnosis: Diagnosis | None) -> str:
    """Say what the model and the FRFs were corrected by, for the key of a stage.

    Parameters
    ----------
    diagnosis : Diagnosis or None
        What was applied, if anything was.

    Returns
    -------
    str
        Empty for nothing.
    """
    return "" if diagnosis is None else repr(diagnosis.findings)


def _write_json(table: dict[str, object], path: Path) -> None:
    write_text(path, json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
