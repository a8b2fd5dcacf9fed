"""SegmentSet of recordings as laws are fitted to them, and whether their converters turned the phase.

SegmentSet are longer where a linear model leaves little. Where no law explains the recordings as they are, they are
looked at again without the dispersion of their converters (`recorded.dispersion`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.diagnosis.measured.preprocessing.dispersion import remove_dispersion
from frf_ipz.diagnosis.nonlinear.fitting.candidates import LawFitProgress
from frf_ipz.diagnosis.nonlinear.fitting.force_localisation import anywhere, whereabouts
from frf_ipz.diagnosis.nonlinear.fitting.output_error_fit import fit_output_error
from frf_ipz.diagnosis.nonlinear.fitting.score_test import fit_linear
from frf_ipz.diagnosis.nonlinear.linear.nuisance_prior import make_nuisance_prior
from frf_ipz.diagnosis.nonlinear.recorded.segments import Window, starts_at_rest, transform

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.diagnosis.nonlinear.fitting.refine import LawFit
    from frf_ipz.diagnosis.nonlinear.linear.modal_model import ModalModel
    from frf_ipz.diagnosis.nonlinear.recorded.noise import ChannelNoise
    from frf_ipz.diagnosis.nonlinear.recorded.segments import SegmentSet
    from frf_ipz.diagnosis.observations import Observations
    from frf_ipz.diagnosis.options import DiagnoseOptions

SHORT, LONG = 80.0, 320.0  # periods of the top of the band: lengths of the stretches that are fitted
LONGER = 640.0  # of records from rest of a shaker, which takes time to shake up a structure
WEAK, TWICE = 1.0, 2.0  # mean square that a linear model leaves below which stretches are longer, and how much
LONGER_BY = 1.2  # times as long, where records are long enough
ROUGH, FINE = 0.01, 0.005  # of the response: what the model may miss on short and long stretches
USUAL, FINEST = 0.5, 0.001  # mean square that data leave whose variance is right; with less, the model misses less
DISPERSIONS = 0.0, 2.0, 3.5, 5.0  # rad: filters that fall by 0, 55, 95 and 135 dB
STEPS = 6  # of a law's fit for each of them
NEAR = 0.5  # rad: how far from the best of them others are tried


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedSegments:
    """What laws are fitted to.

    Parameters
    ----------
    training, held_out : Observations
        What is fitted, and what is not shown.
    modal_model : ModalModel
        The structure.
    noise : ChannelNoise
        Of all recordings.
    options : DiagnoseOptions
        Tolerances.
    dispersion_rad : float
        What was taken back already of the converters' dispersion, rad.
    """

    training: Observations
    held_out: Observations
    modal_model: ModalModel
    noise: ChannelNoise
    options: DiagnoseOptions
    dispersion_rad: float = 0.0

    def without(self, dispersion_rad: float) -> FittedSegments:
        """Take back a dispersion of the converters, rad."""
        training, held_out = (
            remove_dispersion(part, dispersion_rad - self.dispersion_rad) for part in (self.training, self.held_out)
        )
        return replace(self, training=training, held_out=held_out, dispersion_rad=dispersion_rad)

    def track(self, duration_s: float, floor: float, *, loudest: bool) -> LawFitProgress:
        """Cut stretches, with room for a force anywhere."""
        window = Window(duration_s=duration_s, floor=floor, loudest=loudest)
        stretches = transform(self.training, self.modal_model, self.noise, window)
        nuisance_prior = make_nuisance_prior(self.modal_model, stretches, self.training.band_hz[1], self.options)
        return LawFitProgress(
            stretches=stretches, linear=fit_linear(stretches, nuisance_prior), where=anywhere(self.modal_model)
        )

    def tracks(self) -> tuple[LawFitProgress, LawFitProgress]:
        """Cut short and long stretches, and look where a force may sit."""
        short, long = self._tracks()
        where = whereabouts(long.stretches, long.linear)
        return replace(short, where=where), replace(long, where=where)

    def held_out_as(self, long: LawFitProgress) -> SegmentSet | None:
        """Cut what is held out as what was fitted; nothing where no place has blows to spare."""
        if not self.held_out.records:
            return None
        window = Window(duration_s=long.stretches.duration_s, floor=FINE)
        return transform(self.held_out, self.modal_model, self.noise, window)

    def best_dispersion(self, long: LawFitProgress, fit: LawFit) -> float:
        """Say with which dispersion of the converters a law explains best, rad; 0 where none does better.

        Parameters
        ----------
        long : LawFitProgress
            Of these recordings.
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
        about = _lowest(DISPERSIONS[first : first + 3], costs[first : first + 3])
        near = [about - NEAR, about, about + NEAR]
        return max(_lowest(near, [self._cost_without(dispersion, long, fit) for dispersion in near]), 0.0)

    def _cost_without(self, dispersion_rad: float, long: LawFitProgress, fit: LawFit) -> float:
        again = transform(self.without(dispersion_rad).training, self.modal_model, self.noise, long.stretches.window)
        return fit_output_error(again, long.linear.nuisance_prior, fit.start(), iterations=STEPS).cost

    def _tracks(self) -> tuple[LawFitProgress, LawFitProgress]:
        """Both are longer where a linear model leaves little."""
        from_rest = self.training.kind != "hammer" and all(starts_at_rest(record) for record in self.training.records)
        period = 1 / self.training.band_hz[1]
        duration = (LONGER if from_rest else LONG) * period
        long = self.track(duration, FINE, loudest=False)
        is_linear = long.missed < USUAL  # as far as its first parts say
        if is_linear and from_rest:
            duration = LONG * period  # how a louder stretch starts is not known, and the longer, the more that matters
            long = self.track(duration, FINE, loudest=True)
        floor, is_weak = FINE, long.missed < WEAK
        if long.missed < USUAL:
            floor = max(FINE * float(np.sqrt(long.missed / USUAL)), FINEST)
            long = self.track(duration, floor, loudest=is_linear)
        if is_weak:
            longer = self.track(TWICE * duration, floor, loudest=is_linear)
            if longer.stretches.n_samples > LONGER_BY * long.stretches.n_samples:
                return long, longer
        return self.track(SHORT * period, ROUGH, loudest=is_linear), long


def _lowest(places: Sequence[float], costs: Sequence[float]) -> float:
    """Lowest point of the parabola through three points, within their range."""
    bend, slope, _ = np.polyfit(places, costs, 2)
    best = places[int(np.argmin(costs))]
    return best if bend <= 0 else float(np.clip(-slope / (2 * bend), places[0], places[-1]))
