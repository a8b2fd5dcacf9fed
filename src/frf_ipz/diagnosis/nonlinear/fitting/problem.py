"""Law-fit problems: the segments of a test, the linear model fitted to them, and the locations where a force may act.

Segments are longer where the misfit of a linear model is small. Where no law explains the records, a second search is
made without the dispersion of their converters (`measured.preprocessing.dispersion`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.deadline import NO_LIMIT, Deadline
from frf_ipz.diagnosis.measured.preprocessing.dispersion import remove_dispersion
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import all_locations, localise_force, neighbours
from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import fit_linear
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.time_steps import first_steps
from frf_ipz.diagnosis.nonlinear.model.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.segments import SegmentWindow, cut_segments, starts_at_rest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.channel_noise import ChannelNoise
    from frf_ipz.diagnosis.nonlinear.fitting.alternating_fit import LawFit
    from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import ForceLocalisation
    from frf_ipz.diagnosis.nonlinear.fitting.linear_fit import LinearFit
    from frf_ipz.diagnosis.nonlinear.model.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.segments import SegmentSet
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions

NEIGHBOURS = 3  # of a location: near an end that moves freely the two most similar are both closer to the end
SHORT, LONG = 80.0, 320.0  # periods of the top of the band: lengths of segments
FROM_REST = 640.0  # of records from rest of a shaker, which takes time to excite a structure
WEAK, LONGER = 1.0, 2.0  # mean square misfit of the linear model below which segments are longer, and how much
MIN_LONGER = 1.2  # times as long, where records are long enough
ROUGH, FINE = 0.01, 0.005  # of the response: expected error of the model on short and long segments
USUAL, FINEST = 0.5, 0.001  # mean square misfit of data whose variance is right; with less, the model errs less
DISPERSIONS = 0.0, 2.0, 3.5, 5.0  # rad: filters that fall by 0, 55, 95 and 135 dB
STEPS = 6  # of a law's fit for each of them
DISPERSION_STEP = 0.5  # rad: how far from the best of them two others are tried


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawFitProblem:
    """Segments of one length, and the linear model fitted to them.

    Parameters
    ----------
    segments : SegmentSet
        The data.
    linear : LinearFit
        The linear model.
    localisation : ForceLocalisation
        Where a force may act.
    deadline : Deadline
        When no further law is fitted: then DeadlineError is raised.
    """

    segments: SegmentSet
    linear: LinearFit
    localisation: ForceLocalisation
    deadline: Deadline = NO_LIMIT

    @property
    def mean_misfit(self) -> float:
        """Mean square misfit of the linear model over the expected one."""
        return self.linear.cost / self.linear.n_rows

    @property
    def duration_s(self) -> float:
        """Length of the segments, s."""
        return self.segments.duration_s

    def with_steps(self, steps_per_sample: int) -> LawFitProblem:
        """Simulate in other time steps."""
        return replace(self, segments=replace(self.segments, steps_per_sample=steps_per_sample))

    def neighbours_of(self, location: int) -> list[int]:
        """Possible locations among the few that move most like a location."""
        nearest = neighbours(self.linear.nuisance_prior.modal_model, location, NEIGHBOURS)
        return [index for index in nearest if index in self.localisation.possible]

    def fit_output_error(self, fit: LawFit, iterations: int) -> LawFit:
        """Fit a law by simulation, from a fit to these or other segments."""
        self.deadline.check()
        n_structural = self.linear.nuisance_prior.n_structural
        nuisance = fit.nuisance
        if len(nuisance) != len(self.linear.nuisance) or fit.n_rows != self.linear.n_rows:
            nuisance = np.concatenate([fit.nuisance[:n_structural], self.linear.nuisance[n_structural:]])
        start = fit.start(nuisance)
        return fit_output_error(
            self.segments, self.linear.nuisance_prior, start, iterations=iterations, known=fit.simulation
        )

    def fit_output_error_afresh(self, fit: LawFit, iterations: int) -> LawFit:
        """Fit a law by simulation from its parameters and the nominal linear model."""
        self.deadline.check()
        start = fit.start(self.linear.start_nuisance)
        return fit_output_error(self.segments, self.linear.nuisance_prior, start, iterations=iterations)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LawFitData:
    """Records, model and tolerances of law-fit problems.

    Parameters
    ----------
    training, held_out : Observations
        Records that are fitted, and records that are not.
    modal_model : ModalModel
        The structure.
    noise : ChannelNoise
        Of all records.
    options : DiagnoseOptions
        Tolerances.
    deadline : Deadline
        When no further law is fitted.
    dispersion_rad : float
        Dispersion of the converters that has been removed already, rad.
    """

    training: Observations
    held_out: Observations
    modal_model: ModalModel
    noise: ChannelNoise
    options: DiagnoseOptions
    deadline: Deadline = NO_LIMIT
    dispersion_rad: float = 0.0

    def without_dispersion(self, dispersion_rad: float) -> LawFitData:
        """Remove a dispersion of the converters, rad."""
        training, held_out = (
            remove_dispersion(part, dispersion_rad - self.dispersion_rad) for part in (self.training, self.held_out)
        )
        return replace(self, training=training, held_out=held_out, dispersion_rad=dispersion_rad)

    def make_problem(self, duration_s: float, floor: float, *, loudest: bool) -> LawFitProblem:
        """Cut segments of one length, with all locations possible."""
        window = SegmentWindow(duration_s=duration_s, floor=floor, loudest=loudest)
        segments = cut_segments(self.training, self.modal_model, self.noise, window)
        segments = replace(segments, steps_per_sample=first_steps(segments, self.training.band_hz[1]))
        nuisance_prior = make_nuisance_prior(self.modal_model, segments, self.training.band_hz[1], self.options)
        return LawFitProblem(
            segments=segments,
            linear=fit_linear(segments, nuisance_prior),
            localisation=all_locations(self.modal_model),
            deadline=self.deadline,
        )

    def make_problems(self) -> tuple[LawFitProblem, LawFitProblem]:
        """Cut short and long segments, and localise the force by the long ones."""
        short, long = self._choose_lengths()
        localisation = localise_force(long.segments, long.linear)
        return replace(short, localisation=localisation), replace(long, localisation=localisation)

    def held_out_segments(self, long: LawFitProblem) -> SegmentSet | None:
        """Cut the records held out as those that are fitted; None without such records."""
        if not self.held_out.records:
            return None
        window = SegmentWindow(duration_s=long.segments.duration_s, floor=FINE)
        return cut_segments(self.held_out, self.modal_model, self.noise, window)

    def best_dispersion(self, long: LawFitProblem, fit: LawFit) -> float:
        """Estimate the dispersion of the converters with which a law explains best, rad; 0 where none does better.

        Parameters
        ----------
        long : LawFitProblem
            Of these records.
        fit : LawFit
            To them.

        Returns
        -------
        float
            Between those that are tried, by a parabola.
        """
        costs = [fit.cost, *(self._cost_without(dispersion, long, fit) for dispersion in DISPERSIONS[1:])]
        best = int(np.argmin(costs))
        if best == 0:
            return 0.0
        first = min(best - 1, len(costs) - 3)
        middle = _parabola_minimum(DISPERSIONS[first : first + 3], costs[first : first + 3])
        closer = [middle - DISPERSION_STEP, middle, middle + DISPERSION_STEP]
        costs_closer = [self._cost_without(dispersion, long, fit) for dispersion in closer]
        return max(_parabola_minimum(closer, costs_closer), 0.0)

    def _cost_without(self, dispersion_rad: float, long: LawFitProblem, fit: LawFit) -> float:
        self.deadline.check()
        training = self.without_dispersion(dispersion_rad).training
        segments = cut_segments(training, self.modal_model, self.noise, long.segments.window)
        segments = replace(segments, steps_per_sample=long.segments.steps_per_sample)
        return fit_output_error(segments, long.linear.nuisance_prior, fit.start(), iterations=STEPS).cost

    def _choose_lengths(self) -> tuple[LawFitProblem, LawFitProblem]:
        """Cut short and long segments; both are longer where the misfit of the linear model is small."""
        from_rest = self.training.kind != "hammer" and all(starts_at_rest(record) for record in self.training.records)
        period = 1 / self.training.band_hz[1]
        duration = (FROM_REST if from_rest else LONG) * period
        long = self.make_problem(duration, FINE, loudest=False)
        is_linear = long.mean_misfit < USUAL  # by the first part of the records
        if is_linear and from_rest:
            duration = LONG * period  # the state of a louder segment is unknown, and matters more in a longer one
            long = self.make_problem(duration, FINE, loudest=True)
        floor, is_weak = FINE, long.mean_misfit < WEAK
        if long.mean_misfit < USUAL:
            floor = max(FINE * float(np.sqrt(long.mean_misfit / USUAL)), FINEST)
            long = self.make_problem(duration, floor, loudest=is_linear)
        if is_weak:
            longer = self.make_problem(LONGER * duration, floor, loudest=is_linear)
            if longer.segments.n_samples > MIN_LONGER * long.segments.n_samples:
                return long, longer
        return self.make_problem(SHORT * period, ROUGH, loudest=is_linear), long


def _parabola_minimum(points: Sequence[float], costs: Sequence[float]) -> float:
    """Minimum of the parabola through three points, within their range."""
    curvature, slope, _ = np.polyfit(points, costs, 2)
    best = points[int(np.argmin(costs))]
    return best if curvature <= 0 else float(np.clip(-slope / (2 * curvature), points[0], points[-1]))
