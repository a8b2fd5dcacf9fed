"""What explains a test nearly as well as the best does, weighed again with smaller tolerances of the model.

Tolerances are bounds that a user states; many a model is better. Where it is, a cause at a wrong place needs more of
them than the right one, and that counts for little as long as they are thought to be large. Each contender's evidence
is the mean of what it is with the stated tolerances and with parts of them: a model that needs them as they are makes
those vanish, and nothing changes. How much of its FRFs no parameter of the model stands for is a part of the
tolerance too; the best explanation says which part is likely.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.search.contenders import TIE, fit_contenders
from frf_ipz.diagnosis.search.polish import polish
from frf_ipz.diagnosis.search.search import Ranking
from frf_ipz.diagnosis.search.set_up import with_errors

if TYPE_CHECKING:
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.fit import Data, Fit

PARTS = (0.3, 0.1)  # of the tolerances of stiffness, mass and frequencies
FLOORS = (0.3, 0.1)  # parts of the errors of FRFs that no parameter stands for
MOST = 24  # fits that are weighed again


def settle_ties(bench: Bench, ranking: Ranking) -> Ranking:
    """Fit what may be as probable as the best, and weigh again what is.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        With other evidences relative to each other; the largest stays what it was.
    """
    if not ranking.fits or not ranking.fits[0].is_nearly_all:
        return ranking
    if ranking.fits[0].log_evidence > ranking.base.log_evidence + TIE:
        ranking = fit_contenders(bench, ranking)
    best = ranking.fits[0].log_evidence
    near = [fit for fit in ranking.fits if fit.log_evidence > best - TIE][:MOST]
    if len(near) < 2:
        return ranking
    data = _likely_errors(bench, near[0])
    settled = [_Weighed(best=fit, last=fit, log_evidence=fit.log_evidence) for fit in near]
    for part in PARTS:
        strict = replace(bench, nuisance=bench.nuisance.with_part(part), data=data)
        bar = max(one.log_evidence for one in settled) - TIE
        settled = [_weigh(bench, strict, part, one) if one.log_evidence > bar else one for one in settled]
    shift = best - max(one.log_evidence for one in settled)
    weighed = [replace(one.best, log_evidence=one.log_evidence + shift) for one in settled]
    fits = sorted([*weighed, *ranking.fits[len(near) :]], key=lambda fit: -fit.log_evidence)
    return replace(ranking, fits=tuple(fits))


def _likely_errors(bench: Bench, best: Fit) -> Data:
    """Give the data the errors of FRFs that are likeliest by the best explanation."""
    data, options = bench.data, bench.specimen.options
    most = best.log_evidence + data.whitening.log_density
    for floor in FLOORS:
        smaller = with_errors(data.measured, options, free_gains=data.free_gains, floor=floor)
        again = polish(best.hypothesis, smaller, best.values, unknown=best.unknown, iterations=8, tolerance=0.1)
        likely = again.log_evidence + smaller.whitening.log_density
        if likely < most:
            break
        data, most = smaller, likely
    return data


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Weighed:
    """A fit with the likeliest values of all tolerances so far, with those of the last, and its evidence with all."""

    best: Fit
    last: Fit
    log_evidence: float


def _weigh(bench: Bench, strict: Bench, part: float, one: _Weighed) -> _Weighed:
    """Add the evidence with a part of the tolerances, and take the values if they are likelier."""
    nuisance = bench.nuisance
    hypothesis = strict.suppose(one.last.hypothesis.causes)
    unknown = nuisance.in_parts(one.last.unknown, part)
    again = polish(hypothesis, strict.data, one.last.values, unknown=unknown, iterations=8, tolerance=0.1)
    evidence = again.log_evidence + strict.data.whitening.log_density - bench.data.whitening.log_density
    back = nuisance.in_parts(again.unknown, 1 / part)
    pulls, _ = nuisance.pulls(back)
    white = bench.data.misfit(one.last.hypothesis.respond(again.values, back, bench.data.measured.s))
    last = replace(
        one.last,
        values=again.values,
        unknown=back,
        misfit=float(white @ white),
        pull=float(pulls @ pulls),
        log_evidence=evidence,
    )
    return _Weighed(
        best=max(one.best, last, key=lambda fit: fit.log_evidence),
        last=last,
        log_evidence=float(np.logaddexp(one.log_evidence, evidence)),
    )
