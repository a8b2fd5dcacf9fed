"""What a user may choose in ``[ingest]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from frf_ipz.option_types import NotNegative, Positive
from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class IngestOptions:
    """How recordings become FRFs.

    Parameters
    ----------
    estimator : str
        H1 (noise on the responses), H2 (noise on the force) or Hv (on both).
    force_window_s : float, optional
        Length of the force that is kept, from the impact on, s; 0 for no window. Where it is left out, it is chosen
        from the pulse and its ringing.
    exponential_window_s : float, optional
        Time constant of an exponential window on force and response, s; 0 for none. Where it is left out, one is used
        only if a hammer's decays are cut off, and just as strong as that needs.
    segment_s : float, optional
        Length of segments under Hann windows (kind ``random``), s; where it is left out, records are used whole or in
        sub-records, and the transients at both ends are removed.
    keep : tuple of str
        Files, or ``file#2`` for the second impact in a file, that are used whatever the checks say.
    drop : tuple of str
        Files, or ``file#2``, that are left out whatever the checks say.
    hide : tuple of str
        DOFs of sensors whose FRFs are left out, of whatever sign. A known mass of the sensor stays in the model.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.IngestOptions(estimator="Hv", drop=("hits/p18_03.csv",)).estimator
    'Hv'
    """

    __pydantic_config__ = STRICT

    estimator: Literal["H1", "H2", "Hv"] = "H1"
    force_window_s: NotNegative | None = None
    exponential_window_s: NotNegative | None = None
    segment_s: Positive | None = None
    keep: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()
    hide: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_values(self)
