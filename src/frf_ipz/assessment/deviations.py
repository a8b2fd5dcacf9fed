"""How far the models are from what was measured, in dB: the one figure of summary, page, checks and `run.json`.

Of all FRFs at the measured points, and of all at the points of interest, the one stands here of which the updated model
is the furthest off: its median difference of magnitudes over the lines of the band.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.prediction.agreement import compare_frfs
from frf_ipz.prediction.reference import measured_at

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.assessment.measured_points import MeasuredPoints
    from frf_ipz.frf import FrfSet
    from frf_ipz.prediction.prediction import Prediction

UNKNOWN = float("nan")
POINTS, MEASURED = "points of interest", "measured points"


@dataclass(frozen=True, slots=True, kw_only=True)
class FrfDeviation:
    """How far models are from a measured FRF: median difference of magnitudes over a band, dB.

    Parameters
    ----------
    at : str
        ``measured points``, or ``points of interest`` for an FRF that was kept aside.
    frf : str
        The FRF of which the updated model is the furthest off.
    band_hz : pair of float
        From the first to the last line that was compared, Hz.
    nominal_db : float
        Before updating.
    updated_db : float
        After updating.
    with_causes_db : float
        After updating a model that has what the diagnosis found; NaN where it found no cause, and where
        ``[diagnose] apply`` has put it into both of the other models.

    Examples
    --------
    >>> import frf_ipz
    >>> deviation = frf_ipz.FrfDeviation(
    ...     at="points of interest", frf="49:+z / 69:+z", band_hz=(10.0, 700.0), nominal_db=2.34, updated_db=0.117,
    ...     with_causes_db=0.042,
    ... )
    >>> deviation.figures
    '2.3 dB before updating, 0.12 dB after, 0.042 dB with the causes in the model'
    """

    at: str
    frf: str
    band_hz: tuple[float, float]
    nominal_db: float
    updated_db: float
    with_causes_db: float = UNKNOWN

    @property
    def figures(self) -> str:
        """The figures in words."""
        text = f"{self.nominal_db:.2g} dB before updating, {self.updated_db:.2g} dB after"
        causes = f", {self.with_causes_db:.2g} dB with the causes in the model"
        return text + (causes if np.isfinite(self.with_causes_db) else "")

    @property
    def described(self) -> str:
        """Which FRF it is, in words."""
        return "kept aside" if self.at == POINTS else "the worst of those measured"

    @property
    def where(self) -> str:
        """FRF and band in words."""
        low, high = self.band_hz
        return f"{self.frf}, {low:.4g} to {high:.4g} Hz"

    def to_json(self) -> dict[str, object]:
        """Give what stands in `run.json`: plain values, null for what is not known.

        Returns
        -------
        dict
            ``at, frf, band_hz, nominal_db, updated_db, with_causes_db``.
        """
        figures = {name: getattr(self, name) for name in ("nominal_db", "updated_db", "with_causes_db")}
        return {
            "at": self.at,
            "frf": self.frf,
            "band_hz": list(self.band_hz),
            **{name: float(value) if np.isfinite(value) else None for name, value in figures.items()},
        }


def measured_deviation(points: MeasuredPoints) -> FrfDeviation | None:
    """Say how far the models are from the FRFs that were measured.

    Parameters
    ----------
    points : MeasuredPoints
        Models and measurement.

    Returns
    -------
    FrfDeviation or None
        None where no FRF stands above its noise.
    """
    after, worst = worst_median(points.decibels(points.updated))
    if worst < 0:
        return None
    heard_hz = points.frfs.frequency_hz[points.lines][points.is_heard[:, worst]]
    return FrfDeviation(
        at=MEASURED,
        frf=str(points.frfs.labels[worst]),
        band_hz=(float(heard_hz[0]), float(heard_hz[-1])),
        nominal_db=float(np.nanmedian(points.decibels(points.nominal)[:, worst])),
        updated_db=after,
    )


def point_deviation(
    prediction: Prediction,
    *,
    frfs: FrfSet | None = None,
    reference: FrfSet | None = None,
    with_causes: Prediction | None = None,
) -> FrfDeviation | None:
    """Say how far predictions are from FRFs at the points of interest that were measured after all.

    Parameters
    ----------
    prediction : Prediction
        Before and after updating.
    frfs, reference : FrfSet, optional
        Measured FRFs, and those that were kept aside; where there are such, they count.
    with_causes : Prediction, optional
        Of a model with what the diagnosis found.

    Returns
    -------
    FrfDeviation or None
        None where nothing was measured there.
    """
    known = measured_at(prediction, reference) or measured_at(prediction, frfs)
    known = {column: values for column, values in known.items() if np.isfinite(values).any()}
    if not known:
        return None
    off = {column: _median_db(prediction.values[:, column], values) for column, values in known.items()}
    worst = max(off, key=lambda column: off[column])
    lines = np.flatnonzero(np.isfinite(known[worst]))
    causes = UNKNOWN
    if with_causes is not None:  # where the shape alone is predicted, each prediction has its own level
        beside = measured_at(with_causes, reference) or measured_at(with_causes, frfs)
        causes = _median_db(with_causes.values[:, worst], beside[worst])
    return FrfDeviation(
        at=POINTS,
        frf=str(prediction.labels[worst]),
        band_hz=(float(prediction.frequency_hz[lines[0]]), float(prediction.frequency_hz[lines[-1]])),
        nominal_db=_median_db(prediction.nominal[:, worst], known[worst]),
        updated_db=off[worst],
        with_causes_db=causes,
    )


def _median_db(values: np.ndarray, measured: np.ndarray) -> float:
    lines = np.isfinite(measured)
    return float(compare_frfs(measured[lines, None], values[lines, None]).median_db[0])


def worst_median(values: FloatArray) -> tuple[float, int]:
    """Give the largest median of the columns.

    Parameters
    ----------
    values : (n_lines, n_frfs) array
        NaN where there is none.

    Returns
    -------
    float
        The median.
    int
        Its column; -1 where no column has a value.
    """
    columns = np.flatnonzero(np.isfinite(values).any(axis=0))
    if not len(columns):
        return UNKNOWN, -1
    medians = np.nanmedian(values[:, columns], axis=0)
    return float(medians.max()), int(columns[np.argmax(medians)])
