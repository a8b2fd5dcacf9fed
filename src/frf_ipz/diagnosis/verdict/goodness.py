"""How good a fit is: whether anything is missing, and whether what was found is all of it.

The limits were chosen on simulated tests that no reported rate was measured on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arrays import FloatArray, IntArray
from frf_ipz.diagnosis.measured.disagreement import average_over_subbands
from frf_ipz.diagnosis.model.nuisance import UNIFORM_STD

if TYPE_CHECKING:
    from frf_ipz.diagnosis.evidence.fit import Data, Fit
    from frf_ipz.diagnosis.evidence.inference_problem import InferenceProblem
    from frf_ipz.diagnosis.model.layout import Layout

ODDS = 20.0  # to one: what is likelier than that is held to be so, and so much likelier is that nothing is missing
LOG_ODDS = float(np.log(ODDS))
NUISANCE_CHI2_FLOOR = 45.0  # where the data determine few nuisance parameters
NUISANCE_CHI2_DEVIATIONS = 4.0  # standard deviations of that sum by which it may exceed what the data determine
MAX_SINGLE_DEVIATION = 3.2  # standard deviations of a damping ratio or gain: 172 tests with nothing missing reached 2.6


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """What a fit may leave where nothing is missing.

    Parameters
    ----------
    misfit : float
        Sum of squares over the number of values.
    subband : float
        The same of an FRF over a subband.
    frequency_deviation : float
        Standard deviations of one natural frequency: 153 tests with nothing missing reached 1.0; FRFs of two states,
        whose tolerances are learnt from one of them, 2.8.
    """

    misfit: float
    subband: float
    frequency_deviation: float = 2.5

    @property
    def decisive_log_bayes_factor(self) -> float:
        """Log Bayes factor by which one component decides against another: odds, if errors are known to `subband`."""
        return self.subband * LOG_ODDS


# By what was measured: the coarser its noise is known, the wider. Misfit and subband: with nothing missing,
# 50 tests with a hammer reached 0.8 and 1.8, and a nuisance chi2 of 43 (seeds 30101 to 30120, 40001 to 40047), one of
# 63 later ones 3.04 in a subband (from 152000000); 41 with a shaker from rest 1.1 and 1.7, and 60 more with their true
# components 1.2 and 3.6 (from 81000000 and 91000000), one of 8 later ones 4.5 in a subband (from 152000000); 11 with
# shakers that run already, six of them with their true components, 0.7 and 1.5 (from 121000000, 131000000, 141000000).
LIMITS = {
    "hammer": Limits(misfit=1.1, subband=3.6),
    "random": Limits(misfit=1.3, subband=5.0),
    "running": Limits(misfit=1.5, subband=5.0),
    "frf": Limits(misfit=2.2, subband=6.5, frequency_deviation=MAX_SINGLE_DEVIATION),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Goodness:
    """How well a fit explains what was measured.

    Parameters
    ----------
    misfit : float
        Mean square of the whitened misfit.
    nuisance_chi2 : float
        Sum of squares of the nuisance parameters, in standard deviations.
    worst_subband : float
        Largest mean square of an FRF over a subband.
    common_subband : float
        The same of all FRFs of one channel, or of one excited point, over what records disagree by: what a model lacks
        is seen by a channel from all excited points, or from one of them by all channels; and it repeats.
    largest_deviation : float
        Largest deviation of a damping ratio or gain, in standard deviations: small others do not make up for it.
    frequency_deviation : float
        Largest deviation of one natural frequency, in standard deviations.
    limits : Limits
        Their limits.
    nuisance_chi2_limit : float
        Limit of the nuisance chi2.
    """

    misfit: float
    nuisance_chi2: float
    worst_subband: float
    common_subband: float
    largest_deviation: float
    frequency_deviation: float
    limits: Limits
    nuisance_chi2_limit: float

    @property
    def is_good(self) -> bool:
        """True where nothing is left to explain."""
        return self.score <= 1

    @property
    def score(self) -> float:
        """Largest of the figures over their limits."""
        return max(self._over_limits)

    @property
    def shortfall(self) -> str:
        """What is worst about it, in words that begin with "the best explanation"."""
        worst = (
            f"leaves {np.sqrt(self.misfit):.3g} times the expected misfit",
            "needs more than the tolerances of the nominal model allow "
            f"({self.nuisance_chi2:.0f} squared deviations, {self.nuisance_chi2_limit:.0f} are likely)",
            f"leaves {np.sqrt(self.common_subband):.3g} times the expected misfit in one channel, or from one excited "
            "point, over a part of the band",
            f"needs a damping ratio or a gain that is {self.largest_deviation * UNIFORM_STD:.2g} times its tolerance "
            "off",
            f"needs a natural frequency that is {self.frequency_deviation * UNIFORM_STD:.2g} times what the tolerances "
            "allow off",
        )[int(np.argmax(self._over_limits))]
        return f"the best explanation {worst}"

    def good_cost(self, n_values: int) -> float:
        """Compute what a fit costs at most that leaves nothing to explain.

        Parameters
        ----------
        n_values : int
            Number of real values that it is fitted to.

        Returns
        -------
        float
            That of the largest misfit and the largest nuisance parameters.
        """
        return 0.5 * (self.limits.misfit * n_values + self.nuisance_chi2_limit)

    @property
    def error_underestimation(self) -> float:
        """Factor by which errors of a good model are underestimated somewhere: what is beside it needs so much more."""
        return max(1.0, self.worst_subband) if self.is_good else 1.0

    @property
    def _over_limits(self) -> tuple[float, float, float, float, float]:
        return (
            self.misfit / self.limits.misfit,
            self.nuisance_chi2 / self.nuisance_chi2_limit,
            self.common_subband / self.limits.subband,
            (self.largest_deviation / MAX_SINGLE_DEVIATION) ** 2,
            (self.frequency_deviation / self.limits.frequency_deviation) ** 2,
        )


def required_log_bayes_factor(problem: InferenceProblem, base: Goodness, found: Goodness | None = None) -> float:
    """Give the log Bayes factor that one more component needs.

    Of ``N`` kinds each has the prior ``1 / N``; that of its location is in its evidence already. Where the base leaves
    nothing to explain, it is likelier by stated odds that nothing is missing. What is found has to be likelier than all
    else by the same odds.

    A log-likelihood counts the misfit in standard deviations, which are known to a factor only: its squares over a
    subband may be as many times the expected ones as is held to be nothing missing. So much larger a log Bayes factor
    may be than it would be with the right errors, and so much more is needed.

    Parameters
    ----------
    problem : InferenceProblem
        With the effects that are searched for.
    base : Goodness
        Of the fit without the component.
    found : Goodness, optional
        Of the fit with it.

    Returns
    -------
    float
        More where the base leaves more than expected in a subband, and the component does not explain that.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> limits = Limits(misfit=1.1, subband=3.6)
    >>> base = SimpleNamespace(is_good=True, error_underestimation=1.0, limits=limits)
    >>> f"{required_log_bayes_factor(SimpleNamespace(effects=range(17)), base):.1f}"
    '31.8'
    """
    underestimation = base.error_underestimation
    if found is not None:
        underestimation = min(underestimation, found.error_underestimation)
    return underestimation * least_log_bayes_factor(problem, base)


def least_log_bayes_factor(problem: InferenceProblem, base: Goodness) -> float:
    """Give the log Bayes factor that one more component needs at least: where it explains what is left in subbands.

    Parameters
    ----------
    problem : InferenceProblem
        With the effects that are searched for.
    base : Goodness
        Of the fit without the component.

    Returns
    -------
    float
        As `required_log_bayes_factor`, with errors that are right.
    """
    log_odds = LOG_ODDS + float(np.log(max(len(problem.effects), 1)))
    if base.is_good:
        log_odds += LOG_ODDS
    return base.limits.subband * log_odds


def assess_goodness(problem: InferenceProblem, fit: Fit) -> Goodness:
    """Measure how well a fit explains what it was fitted to.

    Parameters
    ----------
    problem : InferenceProblem
        With the data.
    fit : Fit
        Any fit.

    Returns
    -------
    Goodness
        The figures.
    """
    white, nuisance_prior = _whitened_misfit(problem.data, fit), problem.nuisance_prior
    subbands = average_over_subbands(white)
    nuisance_chi2_limit = max(
        NUISANCE_CHI2_FLOOR, fit.n_determined + NUISANCE_CHI2_DEVIATIONS * np.sqrt(2 * fit.n_determined)
    )
    return Goodness(
        misfit=float(np.mean(white**2)),
        nuisance_chi2=fit.nuisance_chi2,
        worst_subband=float(subbands.max()),
        common_subband=_find_common(problem.context.layout, subbands / problem.disagreement),
        largest_deviation=_largest_deviation(
            fit, np.concatenate([nuisance_prior.damping_indices[nuisance_prior.is_stated], nuisance_prior.gain_indices])
        ),
        frequency_deviation=_largest_deviation(fit, nuisance_prior.frequency_indices[nuisance_prior.is_stated]),
        limits=LIMITS[problem.kind],
        nuisance_chi2_limit=float(nuisance_chi2_limit),
    )


def _find_common(layout: Layout, subbands: FloatArray) -> float:
    """Find the largest mean over the FRFs of a channel or of an excited point, (n_frfs, n_subbands)."""
    groups = [index == one for index in (layout.output_index, layout.input_index) for one in np.unique(index)]
    return max(float(subbands[group].mean(axis=0).max()) for group in groups)


def _largest_deviation(fit: Fit, indices: IntArray) -> float:
    return float(np.abs(fit.nuisance[indices]).max(initial=0.0))


def _whitened_misfit(data: Data, fit: Fit) -> np.ndarray:
    """Whitened misfit by FRF, real and imaginary part, and point."""
    response = fit.hypothesis.respond(fit.values, fit.nuisance, data.measured.s)
    return data.misfit(response).reshape(len(data.measured.labels), 2, len(data.measured.s))
