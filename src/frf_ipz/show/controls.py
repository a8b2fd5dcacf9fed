"""Forms and lists by which the user changes a run: plain HTML that the page's script listens to."""

from __future__ import annotations

import json
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.ingest.survey.selection import is_named
from frf_ipz.rational import damping_ratio, natural_frequency_hz
from frf_ipz.report.wording import number, percent

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from frf_ipz.dofs import Dof
    from frf_ipz.identification.modal_fit import ModalFit
    from frf_ipz.pipeline.config import PipelineFile
    from frf_ipz.report.contents import RunContents

USES = {"checks": "as the checks say", "keep": "keep", "drop": "drop"}
REASON = '<label>because <input name="why" type="text" size="26" maxlength="200" placeholder="seen, a cable …"></label>'


def choices_panel(
    choices: PipelineFile | None, problem: str, text: str, command: str, *, is_first: bool = False
) -> str:
    """List what the user has chosen, each with a button that takes it back.

    Parameters
    ----------
    choices : PipelineFile, optional
        None where the pipeline file cannot be read.
    problem : str
        Why it cannot.
    text : str
        The pipeline file.
    command : str
        What repeats this run on the command line.
    is_first : bool
        Nothing has been run yet.

    Returns
    -------
    str
        HTML.
    """
    if choices is None:
        return f'<aside class="notes"><h3>Nothing can be changed</h3><p>{escape(problem)}</p></aside>'
    entries = [*_fit_entries(choices), *_other_entries(choices)]
    items = "".join(
        f"<li>{escape(what)} {_button('take back', wish, label=f'take back: {what}')}</li>" for what, wish in entries
    )
    listed = f"<ul>{items}</ul>" if items else "<p>None yet: click in the pictures below, or use the forms.</p>"
    return (
        f'<h3>Your choices</h3>{listed}<p><button type="button" data-run="1">{"Run" if is_first else "Run again"}'
        "</button></p>"
        f"<details><summary>They stand in pipeline.toml; the command line repeats them</summary>"
        f"<pre>{escape(command)}</pre><pre>{escape(text)}</pre></details>"
    )


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


def pole_controls(fit: ModalFit) -> str:
    """Forms to pin and reject poles and to leave frequency ranges out.

    Parameters
    ----------
    fit : ModalFit
        The fit.

    Returns
    -------
    str
        HTML.
    """
    poles = fit.model.poles[: fit.n_modes]
    rows = "".join(
        f'<tr><th scope="row">{place + 1}</th><td class="n">{number(hertz, 6)}</td><td class="n">{percent(ratio)}</td>'
        f'<td><button type="button" data-fill="{hertz:.8g}" '
        f'aria-label="Pin or reject the mode at {number(hertz, 5)} Hz">Pin or reject …</button> '
        f'<button type="button" data-mode="{place}">Show shape</button></td></tr>'
        for place, (hertz, ratio) in enumerate(zip(natural_frequency_hz(poles), damping_ratio(poles), strict=True))
    )
    return (
        '<div class="work"><p class="tools-of-picture" role="group" aria-label="What dragging does">'
        '<button type="button" data-drag="zoom" aria-pressed="true">Drag: zoom</button> '
        '<button type="button" data-drag="select" aria-pressed="false">Drag: choose a range</button></p>'
        '<form id="pole-form"><h3>A pole</h3>'
        "<p>Click one in the diagram (triangles: the modes of the fit), or write its frequency. A pin where there is "
        "no pole adds one.</p>"
        '<p><label>at <input name="hz" type="number" step="any" min="0" required> Hz</label> '
        f'{REASON}</p><p><button name="kind" value="pin">Pin: a mode is here</button> '
        '<button name="kind" value="reject">Reject: no mode</button></p></form>'
        '<form id="band-form"><h3>A frequency range</h3><p>Drag over it in the diagram, or write its ends.</p>'
        '<p><label>from <input name="low_hz" type="number" step="any" min="0" required></label> '
        '<label>to <input name="high_hz" type="number" step="any" min="0" required> Hz</label></p>'
        '<p><button name="kind" value="exclude">Leave it out</button> '
        '<button name="kind" value="band">Fit only this band</button></p></form></div>'
        f'<div class="scroll" tabindex="0" role="region" aria-label="Modes of the fit"><table id="modes">'
        "<caption>Modes of the fit</caption><thead><tr><th>mode</th><th>frequency, Hz</th><th>damping</th><th></th>"
        f"</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def record_controls(run: RunContents, choices: PipelineFile) -> str:
    """Let the user keep or drop each record.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    choices : PipelineFile
        What the user has chosen.

    Returns
    -------
    str
        HTML; empty where there are no records.
    """
    estimate = run.estimate
    if estimate is None or not len(estimate.records):
        return ""
    rows = ""
    for name, used in zip(estimate.records["record"].astype(str), estimate.records["used"].astype(bool), strict=True):
        is_kept, is_dropped = is_named(name, choices.ingest.keep), is_named(name, choices.ingest.drop)
        chosen = "drop" if is_dropped else "keep" if is_kept else "checks"
        options = "".join(
            f'<option value="{use}"{" selected" if use == chosen else ""}>{text}</option>' for use, text in USES.items()
        )
        label = escape(name, quote=True)
        rows += (
            f'<tr><th scope="row">{label}</th><td>{"used" if used else "left out"}</td>'
            f'<td><select data-record="{label}" aria-label="Use of {label}">{options}</select></td></tr>'
        )
    return (
        '<details class="work-list" id="record-choices"><summary>Keep or drop records</summary><div class="scroll">'
        f"<table><thead><tr><th>record</th><th>now</th><th>your choice</th></tr></thead>"
        f"<tbody>{rows}</tbody></table></div></details>"
    )


def dof_controls(run: RunContents, choices: PipelineFile, retained: Sequence[Dof]) -> str:
    """Forms to choose points of interest, to leave sensors out, and to choose what the model is reduced to.

    Parameters
    ----------
    run : RunContents
        What the run holds.
    choices : PipelineFile
        What the user has chosen.
    retained : sequence of Dof
        What the model is reduced to now; empty where that is not known.

    Returns
    -------
    str
        HTML.
    """
    direction = next((label.output_dof.direction for label in run.labels), "z")
    leave_out = '<button name="kind" value="sensor">Leave this sensor out</button>'
    point = (
        f'<form id="point-form" data-direction="{direction}"><h3>A point of the structure</h3>'
        "<p>Click one in the drawing, or write its DOF, as in 18:+z.</p>"
        '<p><label>DOF <input name="dof" type="text" size="9" required></label> '
    )
    if run.geometry is None:
        return f'<div class="work">{point}{leave_out}</p></form></div>'
    names = escape(" ".join([dof.name for dof in retained] or choices.reduce.dofs), quote=True)
    return (
        f'<div class="work">{point}<button name="kind" value="point">Predict the FRFs here</button> {leave_out} '
        '<button type="button" id="toggle-dof">Keep in the reduction, or not</button></p></form>'
        '<form id="reduce-form"><h3>DOFs that the model is reduced to</h3><p>Ringed in the drawing once the model has '
        "been reduced. As many as modes and residual vectors: one more DOF is one more mode.</p>"
        f'<p><label>DOFs <input name="dofs" type="text" size="44" value="{names}" required></label> '
        '<button name="kind" value="retain">Reduce to these</button></p></form></div>'
    )


def shape_controls(run: RunContents) -> str:
    """Place and buttons of the moving structure.

    Parameters
    ----------
    run : RunContents
        What the run holds.

    Returns
    -------
    str
        HTML.
    """
    fit = run.fit
    modes = "" if fit is None else _mode_options(fit)
    records = "".join(f"<option>{dof}</option>" for dof in run.frfs.input_dofs) if run.frfs is not None else ""
    lines = np.zeros(1) if run.frfs is None else run.frfs.frequency_hz
    return (
        '<div class="work"><form id="shape-form"><p>'
        f'<label>Mode <select name="mode">{modes}<option value="">at a frequency …</option></select></label> '
        '<span id="operating" hidden><label>at <input name="hz" type="number" step="any" '
        f'min="{lines[0]:g}" max="{lines[-1]:g}" value="{np.mean(run.band_hz):.5g}"> Hz</label> '
        f'<label>for a force at <select name="input">{records}</select></label></span> '
        '<button type="button" id="play" aria-pressed="false">Play</button> '
        '<label>phase <input id="phase" type="range" min="0" max="360" value="0"></label></p></form></div>'
        '<figure id="shape"><figcaption id="shape-title">Shape</figcaption><div id="shape-drawing"></div>'
        '<ul class="legend" id="shape-legend"></ul>'
        '<p class="note">Scaled for the eye. Model shapes of a mode are turned and scaled onto the measured one; at a '
        "frequency all are on one scale.</p></figure>"
    )


def _mode_options(fit: ModalFit) -> str:
    hertz = natural_frequency_hz(fit.model.poles[: fit.n_modes])
    return "".join(
        f'<option value="{place}">{place + 1}: {number(value, 5)} Hz</option>' for place, value in enumerate(hertz)
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


def _button(text: str, wish: dict[str, object], *, label: str = "") -> str:
    name = f' aria-label="{escape(label, quote=True)}"' if label else ""
    return f'<button type="button"{name} data-change="{escape(json.dumps(wish), quote=True)}">{escape(text)}</button>'
