"""Diagnosis: where model and measurement disagree, what explains it, and the proof on what was not shown to the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.result import Estimate
from frf_ipz.plotting.diagnosis import (
    MOST_ALTERNATIVES,
    compared_misfits,
    effect_name,
    evidence_text,
    held_out_name,
    probability_text,
)
from frf_ipz.plotting.wording import number, percent, with_error
from frf_ipz.report.findings import mismatch_sentence, typeset, verdict_of
from frf_ipz.report.section import Block, Section, Table, run_figures

if TYPE_CHECKING:
    import pandas as pd

    from frf_ipz.diagnosis.result import Diagnosis, Finding
    from frf_ipz.runs.results import Results


WHOLE_HINT = "Double-click to see the whole record."


def build(run: Results) -> Section | None:
    """Give the section on the diagnosis.

    Parameters
    ----------
    run : Results
        What the run holds.

    Returns
    -------
    Section or None
        None where no diagnosis was made.
    """
    diagnosis: Diagnosis | None = run.diagnosis
    if diagnosis is None:
        return None
    is_explained = bool(diagnosis.findings or diagnosis.alternatives)
    tables = {"proof": _proof_table(diagnosis), "data-checks": _check_table(diagnosis)}
    if run.level_dependence is not None and len(run.level_dependence.modes):
        tables["level-modes"] = _level_table(run.level_dependence.modes)
    blocks: tuple[Block, ...] = (
        *run_figures(run, "mismatch", "ranking"),
        *([_finding_table(diagnosis)] if is_explained else []),
        *run_figures(run, "law", hints={"law-response": WHOLE_HINT}),
        *run_figures(run, "proof", "expected-misfit", "data-checks", "levels", tables=tables),
        *_detectability(diagnosis),
    )
    lead = typeset(diagnosis.statement) or verdict_of(diagnosis)[0]
    if "diagnose" in run.stale:
        lead = f"Not looked for since the last change. Before it: {lead}"
    notes = (
        *mismatch_sentence(diagnosis),
        *[ambiguity.statement for ambiguity in diagnosis.ambiguity],
        *map(typeset, diagnosis.warnings),
    )
    return Section(anchor="diagnosis", title="Diagnosis", lead=lead, blocks=blocks, notes=notes)


def _finding_table(diagnosis: Diagnosis) -> Table:
    rows = []
    found = "found" if diagnosis.is_explained else "looks like"
    for kind, entries in ((found, diagnosis.findings), ("alternative", diagnosis.alternatives[:MOST_ALTERNATIVES])):
        rows += [
            [
                effect_name(finding.effect),
                kind,
                finding.location.text,
                _parameters(finding),
                probability_text(finding).removeprefix("= "),
                evidence_text(finding),
                typeset(finding.statement if kind == found else _as_hypothesis(finding.statement)),
            ]
            for finding in entries
        ]
    columns = ("effect", "rank", "where", "parameters", "probability", "log Bayes factor", "in words")
    caption = "Findings and alternatives" if diagnosis.findings else "What was tried and is not needed"
    return Table(caption=caption, columns=columns, rows=rows, file="diagnosis.json")


def _as_hypothesis(statement: str) -> str:
    """Say it as no fact: the data prefer what was found."""
    return f"If it were this: {statement[:1].lower()}{statement[1:]}"


def _parameters(finding: Finding) -> str:
    return ", ".join(
        f"{name} = {with_error(value.value, value.std)}" if isinstance(value, Estimate) else f"{name} = {value}"
        for name, value in finding.parameters.items()
    )


def _proof_table(diagnosis: Diagnosis) -> Table:
    rows = [
        [
            name,
            percent(misfit.training),
            percent(misfit.held_out),
            number(misfit.training_noise, 3),
            number(misfit.held_out_noise, 3),
        ]
        for name, misfit in compared_misfits(diagnosis).items()
    ]
    error = f"error, {held_out_name(diagnosis)}"
    columns = ("model", "error, fitted", error, "over what one expects, fitted", "the same, held out")
    return Table(caption="Normalised FRF error", columns=columns, rows=rows, file="diagnosis.json")


def _check_table(diagnosis: Diagnosis) -> Table:
    rows = [
        [
            check.name,
            number(check.value, 3),
            number(check.limit, 3),
            "passed" if check.passed else "failed",
            typeset(check.statement),
        ]
        for check in diagnosis.data_checks
    ]
    return Table(
        caption="Checks", columns=("check", "value", "limit", "result", "in words"), rows=rows, file="diagnosis.json"
    )


def _detectability(diagnosis: Diagnosis) -> list[Table]:
    rows = [
        [effect_name(effect), name, number(float(size), 3)]
        for effect, sizes in diagnosis.detectability.items()
        for name, size in sizes.items()
    ]
    if not rows:
        return []
    caption = "Smallest effects that these data would show, where they show best"
    return [Table(caption=caption, columns=("effect", "parameter", "smallest size"), rows=rows, file="diagnosis.json")]


def _level_table(modes: pd.DataFrame) -> Table:
    rows = [
        [
            str(int(row["mode"]) + 1),
            row["frf"],
            row["record"],
            number(row["level_N"]),
            with_error(row["frequency_hz"], row["frequency_std_hz"]),
            with_error(100 * row["damping_ratio"], 100 * row["damping_ratio_std"]),
        ]
        for row in modes.sort_values(["mode", "frf", "level_N"]).to_dict("records")
    ]
    columns = ("mode", "FRF (output / input)", "record", "peak force, N", "frequency, Hz", "damping ratio, %")
    return Table(caption="Modes of single records", columns=columns, rows=rows)
