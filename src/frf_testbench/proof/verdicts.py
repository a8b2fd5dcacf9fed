"""Judge the verdicts of assessments on simulated campaigns: sound ones, mistaken ones, ones that conceal an effect.

``frf-testbench verdicts FOLDER``. A sound campaign scatters within the tolerances of the simulator; a mistaken one is
sound but for one of `mistakes`; the others conceal an effect each. What is asked of the verdicts: sound campaigns are
usable; a prediction that leaves its 90 % band on more than a quarter of the lines is not called usable; mistakes are
named with the place to correct.

A run searches for causes by itself, and what it finds can only make a verdict worse, and names no mistake. So campaigns
run without the search, and once more with it where that can change what is counted: where the verdict is usable, of the
sound ones and of those whose prediction leaves its band.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import frf_ipz
from frf_testbench.mistakes.campaign_files import CampaignFiles
from frf_testbench.mistakes.mistakes import MISTAKES, Mistake
from frf_testbench.simulator.cases.case import make_case
from frf_testbench.simulator.effects.catalogue import CATALOGUE, OUT_OF_CATALOGUE

ATTEMPTS = 60  # campaigns that are drawn until a mistake can be made with one
SEEDS_APART = 10_000  # between the attempts at one campaign
NO_SEARCH = '\n[diagnose]\nrun = "never"\n'
USABLE = "usable"
LEAVES = 0.25  # of the lines: a 90 % band that misses more is too narrow
GROUPS = ("sound", "mistaken", "concealed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One campaign.

    Parameters
    ----------
    group, name, what : str
        Its group; its folder; the mistake or effect.
    verdict : str
        That of the assessment, or ``refused`` where the run ended with a message.
    cause : str
        The likely cause, or the message.
    is_named : bool
        The mistake was named with its place.
    inside, error_db : float
        Share of the lines at points of interest that the band holds, and the median error; NaN without such points.
    """

    group: str
    name: str
    what: str
    verdict: str
    cause: str
    is_named: bool
    inside: float
    error_db: float


def judge_verdicts(folder: Path, *, first_seed: int, count: int, jobs: int) -> pd.DataFrame:
    """Make campaigns, run them, and set the verdicts against the truth.

    Parameters
    ----------
    folder : Path
        Where campaigns and results are kept; what is there is not made again.
    first_seed : int
        Of the first campaign.
    count : int
        Of each group.
    jobs : int
        Campaigns at the same time.

    Returns
    -------
    DataFrame
        One row a campaign, as `Judged`.
    """
    orders = [(group, number) for group in GROUPS for number in range(count)]
    with ProcessPoolExecutor(jobs) as pool:
        judged = list(pool.map(partial(_judge, folder, first_seed), orders))
    return pd.DataFrame([asdict(one) for one in judged if one is not None])


def summarise_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Count what the verdicts are asked for.

    Parameters
    ----------
    table : DataFrame
        As `judge_verdicts` gives it.

    Returns
    -------
    DataFrame
        One row a question: ``question, count, of``.
    """
    sound, mistaken = table[table["group"] == "sound"], table[table["group"] == "mistaken"]
    leaving = table[table["inside"] < 1 - LEAVES]
    rows = [
        ("sound campaigns called usable", (sound["verdict"] == USABLE).sum(), len(sound)),
        ("predictions that leave their band, called usable", (leaving["verdict"] == USABLE).sum(), len(leaving)),
        ("mistakes named with their place", mistaken["is_named"].sum(), len(mistaken)),
    ]
    return pd.DataFrame(rows, columns=["question", "count", "of"])


def _judge(folder: Path, first_seed: int, order: tuple[str, int]) -> Judged | None:
    group, number = order
    case = folder / "campaigns" / f"{group}_{number:03d}"
    truth = folder / "truth" / f"{case.name}.json"
    mistake = MISTAKES[number % len(MISTAKES)] if group == "mistaken" else None
    what = _make(case, truth, group, number, first_seed + 1000 * GROUPS.index(group) + number, mistake)
    if what is None:
        return None
    judged = _run(folder, group, case, what, mistake, search=False)
    if judged.verdict == USABLE and (group == "sound" or judged.inside < 1 - LEAVES):
        judged = _run(folder, group, case, what, mistake, search=True)
    return judged


def _run(folder: Path, group: str, case: Path, what: str, mistake: Mistake | None, *, search: bool) -> Judged:
    pipeline = case / ("pipeline.toml" if search else "without_search.toml")
    try:
        results = frf_ipz.run_pipeline(pipeline, folder / "results" / case.name, until="predict")
    except frf_ipz.FrfIpzError as error:
        named = mistake is not None and re.search(mistake.names, str(error)) is not None
        return _judged(group, case.name, what, "refused", str(error), is_named=named)
    assessment = results.assessment
    if assessment is None:  # there is a model and a prediction, so there is an assessment of it
        raise RuntimeError(f"{case}: no assessment")
    cause = assessment.likely_cause
    is_named = mistake is not None and cause is not None and re.search(mistake.names, cause.line_or_key) is not None
    inside, error_db = _at_points(results, folder / "truth" / f"{case.name}_points.csv")
    says = "" if cause is None else cause.says
    return _judged(
        group, case.name, what, assessment.verdict.value, says, is_named=is_named, inside=inside, error_db=error_db
    )


def _make(case: Path, truth: Path, group: str, number: int, seed: int, mistake: Mistake | None) -> str | None:
    """Make a campaign, and say what is wrong with it; None where no campaign could be drawn."""
    note = truth.with_suffix(".what.json")
    if note.is_file():
        return str(json.loads(note.read_text(encoding="utf-8"))["what"])
    effects = [*CATALOGUE, *(f"unknown:{kind}" for kind in OUT_OF_CATALOGUE)]
    effect = effects[number % len(effects)] if group == "concealed" else "null"
    what = effect if mistake is None else mistake.name
    for attempt in range(ATTEMPTS if mistake else 1):
        shutil.rmtree(case, ignore_errors=True)
        make_case(seed + SEEDS_APART * attempt, effect).write(case, truth)
        if mistake is None or mistake.apply(CampaignFiles(case), np.random.default_rng(seed)):
            pipeline = (case / "pipeline.toml").read_text(encoding="utf-8")
            (case / "without_search.toml").write_text(pipeline + NO_SEARCH, encoding="utf-8")
            note.write_text(json.dumps({"what": what}), encoding="utf-8")
            return what
    return None


def _at_points(results: frf_ipz.Results, truth: Path) -> tuple[float, float]:
    prediction = results.prediction
    if prediction is None or not truth.is_file():
        return float("nan"), float("nan")
    pairs = list(_true_and_predicted(prediction, pd.read_csv(truth)))
    if not pairs:
        return float("nan"), float("nan")
    return float(np.mean([inside for inside, _ in pairs])), float(np.mean([error for _, error in pairs]))


def _true_and_predicted(prediction: frf_ipz.Prediction, truth: pd.DataFrame) -> Iterator[tuple[float, float]]:
    for place, label in enumerate(prediction.labels):
        rows = truth[(truth["output_dof"] == str(label.output_dof)) & (truth["input_dof"] == str(label.input_dof))]
        known_hz, known = rows["frequency_hz"].to_numpy(), np.hypot(rows["real"].to_numpy(), rows["imag"].to_numpy())
        if not len(known):
            continue
        lines = (prediction.frequency_hz >= known_hz[0]) & (prediction.frequency_hz <= known_hz[-1])
        true = np.interp(prediction.frequency_hz[lines], known_hz, known)
        low, high = prediction.magnitude_low[lines, place], prediction.magnitude_high[lines, place]
        error = np.abs(20 * np.log10(np.abs(prediction.values[lines, place]) / true))
        yield float(np.mean((true >= low) & (true <= high))), float(np.median(error))


def _judged(
    group: str,
    name: str,
    what: str,
    verdict: str,
    cause: str,
    *,
    is_named: bool,
    inside: float = float("nan"),
    error_db: float = float("nan"),
) -> Judged:
    return Judged(
        group=group,
        name=name,
        what=what,
        verdict=verdict,
        cause=cause,
        is_named=is_named,
        inside=inside,
        error_db=error_db,
    )
