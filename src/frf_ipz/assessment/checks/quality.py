"""What a prediction rests on: the fit, the size of the changes, the scale, and whether causes were looked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.assessment.checks.agreement import NORMAL_90
from frf_ipz.control_margins import GAIN_MARGIN_DB, SIXTH
from frf_ipz.updating.mass_evidence import frequency_factor
from frf_ipz.updating.parameters import MASS_STD

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.assessment.evidence import Evidence

WORST_MISFIT = 10.0  # times the noise: stated deviations of poles and zeros then mean nothing
NO_CHANCE = 3.0  # standard deviations: once in 370 runs
PLAUSIBLE_RATIO = 2.0  # of a stiffness: no tolerance of a material or a joint doubles or halves it


def fit(evidence: Evidence) -> Iterator[Check]:
    """Ask how well the fitted model reproduces the measured FRFs.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where the misfit is known.
    """
    misfit = evidence.fit.misfit
    if "ratio" not in misfit or not np.isfinite(misfit["ratio"]).any():
        return
    ratios, sizes_db = misfit["ratio"].to_numpy(float), _misfit_db(evidence)
    costs = (ratios > WORST_MISFIT) & (sizes_db > SIXTH * GAIN_MARGIN_DB)
    worst = int(np.nanargmax(np.where(costs, ratios, -1.0) if costs.any() else ratios))
    row, ratio = misfit.iloc[worst], float(ratios[worst])
    where = f"{row['output_dof']} / {row['input_dof']}"
    yield Check(
        name="misfit of the fit",
        verdict=Verdict.WITH_CARE if costs.any() else Verdict.USABLE,
        figure=ratio,
        limit=WORST_MISFIT,
        unit="noise",
        where=where,
        says=f"the fit leaves {ratio:.2g} times the noise of {where}, {sizes_db[worst]:.2g} dB of it; "
        "1 is all that the measurement can tell",
        advice="narrow [fit] band_hz, or look at the recordings of that FRF" if costs.any() else "",
    )


def impacts(evidence: Evidence) -> Iterator[Check]:
    """Ask whether impacts that contradict the others are the hardest or the softest ones.

    An impact is left out where it contradicts the others. Where all of its responses do, and no fault of a recording
    explains it, the structure itself may have moved otherwise: a gap that closes, friction that holds.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where there are such impacts.
    """
    records = evidence.records
    unlike = records[records["unlike_others"].astype(bool) & ~records["used"].astype(bool)]
    for input_dof in unlike["input_dof"].unique():
        peaks = records.loc[records["input_dof"] == input_dof, "peak_force_N"].abs()
        at_point = unlike[unlike["input_dof"] == input_dof]
        ends = {peaks.idxmax(): "hardest", peaks.idxmin(): "softest"}
        extreme = next((row for row in at_point.index if row in ends), None)
        if extreme is None:
            continue
        record = records.loc[extreme]
        yield Check(
            name="impacts left out",
            verdict=Verdict.WITH_CARE,
            figure=float(peaks[extreme]),
            unit="N",
            where=str(input_dof),
            says=f"the {ends[extreme]} impact at {input_dof}, {record['record']} ({peaks[extreme]:.3g} N), contradicts "
            "the others in all responses, and no fault of the recording explains it: the machine may move otherwise at "
            "that level",
            advice="strike it as hard as it is driven in use, several times at each level, and compare the FRFs",
        )


def _misfit_db(evidence: Evidence) -> FloatArray:
    """Give what the misfit is of each FRF and band beside the FRF itself, dB: (n_rows,)."""
    powers, lines_hz = np.abs(evidence.measured) ** 2, evidence.frfs.frequency_hz[evidence.lines]
    rows = evidence.fit.misfit[["frf", "band_low_hz", "band_high_hz", "misfit"]].itertuples(index=False)
    return np.array(
        [
            20 * np.log10(1 + size / np.sqrt(np.nanmean(powers[(lines_hz >= low) & (lines_hz <= high), int(frf)])))
            for frf, low, high, size in rows
        ]
    )


def parameters(evidence: Evidence) -> Iterator[Check]:
    """Ask whether the update had to change parts of the model beyond what is plausible.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where parts were changed.
    """
    parts = evidence.updated_model.parts
    if not len(parts):
        return
    ratios = parts["stiffness_ratio"].to_numpy(float)
    extent = np.maximum(ratios, 1 / np.maximum(ratios, np.finfo(float).tiny))
    worst = int(np.argmax(extent))
    where = str(parts["name"].iloc[worst])
    too_much = bool(extent[worst] > PLAUSIBLE_RATIO)
    yield Check(
        name="changes of the model",
        verdict=Verdict.WITH_CARE if too_much else Verdict.USABLE,
        figure=float(extent[worst]),
        limit=PLAUSIBLE_RATIO,
        unit="1",
        where=where,
        says=f"the largest change of a stiffness is to {ratios[worst]:.3g} times its value, of {where}",
        advice="no tolerance explains that: look for what the model leaves out" if too_much else "",
    )


def targets(evidence: Evidence) -> Iterator[Check]:
    """Say where nothing could be updated.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where there was no target.
    """
    if not evidence.has_targets:
        yield Check(
            name="targets of the update",
            verdict=Verdict.NOT_USABLE,
            figure=0.0,
            limit=1.0,
            unit="1",
            says="no measured pole or zero has a counterpart in the model, so the model is left as it was",
            advice="check units, materials, supports and node numbers of the FE model",
        )


def scale(evidence: Evidence) -> Iterator[Check]:
    """Say where predictions are relative, because the scale of the measurement is not known.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where the scale is unknown.
    """
    if not evidence.is_relative:
        return
    fitted, prediction = evidence.updated_model.scale, evidence.prediction
    is_known = fitted.is_fitted and not prediction.relative
    deviations = [fitted.std_db(label) for label in prediction.labels or evidence.frfs.labels]
    yield Check(
        name="scale",
        verdict=Verdict.USABLE if is_known else Verdict.WITH_CARE,
        figure=max(deviations) if fitted.is_fitted else float("nan"),
        unit="dB",
        says=fitted.statement,
        advice="" if is_known else "calibrate the test, or use the prediction's shape only",
    )


def level(evidence: Evidence) -> Iterator[Check]:
    """Say where measured amplitudes are off those of the model, all by one factor: its mass is in doubt.

    A unit or sensitivity of the test that is wrong looks alike, but for the frequencies, which a mass moves too. Where
    they are off by that factor alike, two measurements agree, and less is believed.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where the factor is beyond its own error; it costs the verdict where it is beyond what masses of models are
        off as well.
    """
    updated = evidence.updated_model
    is_updated = updated.expansion is None  # measured shapes have the measured amplitudes
    fitted = updated.scale if is_updated else updated.nominal_scale
    if fitted.is_relative:
        return
    doubt = float(np.log(fitted.level))
    log_factor, factor_std = frequency_factor(updated.pairs or evidence.pairs, updated.before)
    is_told = abs(log_factor) > NO_CHANCE * factor_std
    is_told &= abs(log_factor - doubt) < NORMAL_90 * float(np.hypot(fitted.level_std, factor_std))
    limit = (NORMAL_90 if is_told else NO_CHANCE) * float(np.hypot(fitted.level_std, MASS_STD))
    if abs(doubt) <= min(limit, NO_CHANCE * fitted.level_std):
        return
    low, high = (np.exp(doubt + side * NORMAL_90 * fitted.level_std) for side in (-1, 1))
    off, *ends = (100 * abs(float(np.expm1(value))) for value in (doubt, np.log(low), np.log(high)))
    model = f"the model is {off:.2g} % {'heavier' if doubt > 0 else 'lighter'} than the machine"
    interval = f"(90 %: {min(ends):.2g} to {max(ends):.2g} %)"
    test = f"a unit or sensitivity of the test is off (probability of the mass: {fitted.probability_of_mass:.2g})"
    higher = f"{abs(100 * float(np.expm1(log_factor / 2))):.2g} % {'higher' if log_factor > 0 else 'lower'}"
    what = f"either {model} {interval} in these modes, or {test}"
    if is_told:
        what = (
            f"{model} {interval}, as frequencies tell too, which are all {higher}; else its stiffness is off and {test}"
        )
    yield Check(
        name="mass of the model",
        verdict=Verdict.WITH_CARE if abs(doubt) > limit else Verdict.USABLE,
        figure=abs(doubt),
        limit=limit,
        unit="1",
        says=f"measured amplitudes of modes are {fitted.level:.3g} times those of the model ({low:.3g} to {high:.3g}): "
        f"{what}; {'bands reach from one to the other' if is_updated else 'the prediction goes by the test'}",
        advice="weigh the structure and compare with its model; look at the sensitivities of force and responses",
    )


def diagnosis(evidence: Evidence) -> Iterator[Check]:
    """Say what a diagnosis found, or that none was made.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One.
    """
    found = evidence.diagnosis
    if found is None:
        says, verdict, advice = "not looked for", Verdict.USABLE, "frf-ipz diagnose looks for what the model leaves out"
        if not evidence.frfs.n_frfs:
            says, advice = (
                "not looked for: a diagnosis compares FRFs, and modes do not tell what the model leaves out",
                "",
            )
    elif not found.is_explained and not found.has_seen_all:
        says = "something is missing in the model; the time was over before all that may explain it was looked at"
        verdict, advice = Verdict.WITH_CARE, "frf-ipz diagnose looks for the cause without a limit of time"
    elif not found.is_explained:
        says, verdict = "something is missing in the model that no known effect explains", Verdict.WITH_CARE
        advice = "see the section on the diagnosis"
    elif found.findings:
        names = ", ".join(f"{finding.effect.replace('_', ' ')} ({finding.confidence})" for finding in found.findings)
        says, verdict, advice = f"what is missing in the model was found: {names}", Verdict.USABLE, ""
        if evidence.is_corrected:
            says += "; it was put into it"
        else:
            says, verdict = f"{says}; the prediction is made without it", Verdict.WITH_CARE
            advice = "put it into the model, or set [diagnose] apply = true"
    else:
        says, verdict, advice = "nothing significant is missing in the model", Verdict.USABLE, ""
    yield Check(name="diagnosis", verdict=verdict, says=says, advice=advice, is_answered=found is not None)
