"""What explains a test nearly as well as the best does, weighed again with smaller tolerances of the model.

Tolerances are bounds that a user states; many a model is better. Where it is, a cause at a wrong place needs more of
them than the right one, and that counts for little as long as they are thought to be large. Each contender's evidence
is the mean of what it is with the stated tolerances and with a part of them: a model that needs them as they are makes
the second vanish, and nothing changes. How much of its FRFs no parameter of the model stands for is a part of the
tolerance too; the best explanation says which part is likely.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.search.polish import polish
from frf_ipz.diagnosis.search.search import Ranking
from frf_ipz.diagnosis.search.set_up import with_errors

if TYPE_CHECKING:
    from frf_ipz.diagnosis.search.bench import Bench
    from frf_ipz.diagnosis.search.fit import Data, Fit

PART = 0.3  # of the tolerances of stiffness, mass and frequencies
FLOORS = (0.3, 0.1)  # parts of the errors of FRFs that no parameter stands for
TIE = 8.0  # nats behind the best
MOST = 24  # fits that are weighed again


def settle_ties(bench: Bench, ranking: Ranking) -> Ranking:
    """Weigh again what is nearly as probable as the best.

    Parameters
    ----------
    bench : Bench
        Data and effects.
    ranking : Ranking
        Of a search.

    Returns
    -------
    Ranking
        The same fits with other evidences relative to each other; the largest stays what it was.
    """
    if not ranking.fits or not ranking.fits[0].is_nearly_all:
        return ranking
    best = ranking.fits[0].log_evidence
    near = [fit for fit in ranking.fits if fit.log_evidence > best - TIE][:MOST]
    if len(near) < 2:
        return ranking
    strict = replace(bench, nuisance=bench.nuisance.with_part(PART), data=_likely_errors(bench, near[0]))
    settled = [_weighed(bench, strict, fit) for fit in near]
    shift = best - max(fit.log_evidence for fit in settled)
    settled = [replace(fit, log_evidence=fit.log_evidence + shift) for fit in settled]
    fits = sorted([*settled, *ranking.fits[len(near) :]], key=lambda fit: -fit.log_evidence)
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


def _weighed(bench: Bench, strict: Bench, fit: Fit) -> Fit:
    """Give a fit the mean evidence, and the values of the likelier one."""
    nuisance = bench.nuisance
    hypothesis = strict.suppose(fit.hypothesis.causes)
    unknown = nuisance.in_parts(fit.unknown, PART)
    again = polish(hypothesis, strict.data, fit.values, unknown=unknown, iterations=8, tolerance=0.1)
    strictly = again.log_evidence + strict.data.whitening.log_density - bench.data.whitening.log_density
    mean = float(np.logaddexp(fit.log_evidence, strictly))
    if strictly < fit.log_evidence:
        return replace(fit, log_evidence=mean)
    back = nuisance.in_parts(again.unknown, 1 / PART)
    pulls, _ = nuisance.pulls(back)
    white = bench.data.misfit(fit.hypothesis.respond(again.values, back, bench.data.measured.s))
    return replace(
        fit,
        values=again.values,
        unknown=back,
        misfit=float(white @ white),
        pull=float(pulls @ pulls),
        log_evidence=mean,
    )
