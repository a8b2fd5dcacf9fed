"""Forms and lists by which the user changes a run: what this package's templates show and its script listens to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.survey.selection import is_named
from frf_ipz.plotting.wording import number, percent
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.section import Form
from frf_ipz.report.sections.shapes import TEMPLATE, mode_names

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.dofs import AnyDof
    from frf_ipz.frf import FrfSet
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pipeline.config import PipelineFile
    from frf_ipz.runs.results import Results
    from frf_ipz.show.own_code import OwnCode

USES = {"checks": "as the checks say", "keep": "keep", "drop": "drop"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """What the user has chosen, or why nothing can be chosen.

    Parameters
    ----------
    problem : str
        Why the pipeline file cannot be read; empty where it can.
    entries : tuple of Choice
        What was chosen, each with the change that takes it back.
    command : str
        What repeats this run on the command line.
    text : str
        The pipeline file.
    is_first_run : bool
        Nothing has been run yet.
    has_model : bool
        There is an FE model, so that causes of a mismatch can be looked for.
    can_undo, can_redo : bool
        There is a change to undo, or one to make again.
    code : OwnCode, optional
        Code that a run would execute and that nobody has allowed yet.
    """

    problem: str = ""
    entries: tuple[Choice, ...] = ()
    command: str = ""
    text: str = ""
    is_first_run: bool = False
    has_model: bool = False
    can_undo: bool = False
    can_redo: bool = False
    code: OwnCode | None = None


@dataclass(frozen=True, slots=True)
class Choice:
    """One thing that the user has chosen.

    Parameters
    ----------
    text : str
        What.
    wish : dict
        The change that takes it back, as `changes.to_change` reads it.
    """

    text: str
    wish: dict[str, object]


def list_choices(file: PipelineFile) -> tuple[Choice, ...]:
    """List what the user has chosen in a pipeline file.

    Parameters
    ----------
    file : PipelineFile
        The file.

    Returns
    -------
    tuple of Choice
        In the order of the chain.
    """
    return tuple(Choice(text, wish) for text, wish in (*_fit_entries(file), *_other_entries(file)))


def command_line(pipeline: Path, folder: Path) -> str:
    """Give the command that repeats a run.

    Parameters
    ----------
    pipeline, folder : Path
        The pipeline file and the run's folder.

    Returns
    -------
    str
        For a shell.
    """
    quoted = [f'"{path}"' if " " in str(path) else str(path) for path in (pipeline, folder)]
    return f"frf-ipz run {quoted[0]} --out {quoted[1]}"


def pole_forms(fit: ModalFit, frfs: FrfSet | None) -> Form:
    """Let the user pin and reject poles and leave frequency ranges out.

    Parameters
    ----------
    fit : ModalFit
        The fit.
    frfs : FrfSet, optional
        What was measured: the band can be taken as far as there are lines.

    Returns
    -------
    Form
        With a list of the modes.
    """
    poles = fit.model.poles[: fit.n_modes]
    modes = [
        {"frequency": number(hertz, 6), "damping": percent(ratio), "hz": f"{hertz:.8g}", "label": number(hertz, 5)}
        for hertz, ratio in zip(natural_frequency_hz(poles), damping_ratio(poles), strict=True)
    ]
    lines_hz = fit.band_hz if frfs is None else frfs.frequency_hz[[0, -1]]
    bands = {"band_hz": [f"{end:.8g}" for end in fit.band_hz], "lines_hz": [f"{end:.8g}" for end in lines_hz]}
    return Form(template="show/pole_forms.html", data={"modes": modes, **bands})


def record_list(run: Results, choices: PipelineFile) -> Form | None:
    """Let the user keep or drop each record.

    Parameters
    ----------
    run : Results
        What the run holds.
    choices : PipelineFile
        What the user has chosen.

    Returns
    -------
    Form or None
        None where there are no records.
    """
    if run.estimate is None or not len(run.estimate.records):
        return None
    table = run.estimate.records
    records = [
        {"name": name, "is_used": is_used, "use": _use(name, choices)}
        for name, is_used in zip(table["record"].astype(str), table["used"].astype(bool), strict=True)
    ]
    return Form(template="show/record_list.html", data={"records": records, "uses": list(USES.items())})


def _use(name: str, choices: PipelineFile) -> str:
    if is_named(name, choices.ingest.drop):
        return "drop"
    return "keep" if is_named(name, choices.ingest.keep) else "checks"


def dof_forms(run: Results, choices: PipelineFile, retained: Sequence[AnyDof]) -> Form:
    """Let the user choose points of interest, leave sensors out, and choose what the model is reduced to.

    Parameters
    ----------
    run : Results
        What the run holds.
    choices : PipelineFile
        What the user has chosen.
    retained : sequence of Dof
        What the model is reduced to now; empty where that is not known.

    Returns
    -------
    Form
        Without a model, only sensors can be left out.
    """
    return Form(
        template="show/dof_forms.html",
        data={
            "direction": next((label.output_dof.direction for label in run.labels), "z"),
            "has_model": choices.pipeline.model is not None or run.reduced_model is not None,
            "retained": " ".join([dof.name for dof in retained] or choices.reduce.dofs),
        },
    )


def shape_form(run: Results) -> Form:
    """Let the user choose which shape of the structure is animated.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Form
        With the modes of the fit and the inputs of the test.
    """
    frfs = run.frfs
    lines = np.zeros(1) if frfs is None else frfs.frequency_hz
    return Form(
        template=TEMPLATE,
        data={
            "modes": mode_names(run),
            "inputs": [] if frfs is None else [str(dof) for dof in frfs.input_dofs],
            "lowest_hz": f"{lines[0]:g}",
            "highest_hz": f"{lines[-1]:g}",
            "hz": f"{np.mean(run.band_hz):.5g}",
        },
    )


def _fit_entries(choices: PipelineFile) -> list[tuple[str, dict[str, object]]]:
    fit = choices.fit
    entries: list[tuple[str, dict[str, object]]] = []
    if fit.band_hz is not None:
        low, high = fit.band_hz
        entries.append((f"fit {low:g} to {high:g} Hz only", {"kind": "band", "on": False}))
    entries += [
        (f"a mode pinned at {pin.hz:g} Hz{pin.why and ': '}{pin.why}", {"kind": "pin", "hz": pin.hz, "on": False})
        for pin in fit.pinned
    ]
    entries += [
        (
            f"the pole at {pole.hz:g} Hz rejected: {pole.why}",
            {"kind": "reject", "hz": pole.hz, "on": False},
        )
        for pole in fit.strike
    ]
    entries += [
        (f"{low:g} to {high:g} Hz left out", {"kind": "exclude", "low_hz": low, "high_hz": high, "on": False})
        for low, high in fit.exclude_hz
    ]
    return entries


def _other_entries(choices: PipelineFile) -> list[tuple[str, dict[str, object]]]:
    entries: list[tuple[str, dict[str, object]]] = [
        (f"{name} {word}", {"kind": "record", "name": name, "use": "checks"})
        for word, names in (("kept", choices.ingest.keep), ("dropped", choices.ingest.drop))
        for name in names
    ]
    entries += [(f"sensor {dof} left out", {"kind": "sensor", "dof": dof, "on": False}) for dof in choices.ingest.hide]
    if choices.reduce.dofs:
        entries.append((f"reduced to {' '.join(choices.reduce.dofs)}", {"kind": "retain", "on": False}))
    entries += [
        (f"point of interest {dof}", {"kind": "point", "dof": dof, "on": False}) for dof in choices.predict.points
    ]
    return entries
