"""What a user may choose in ``[export]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from frf_ipz.option_types import CountOrNone, NotNegative
from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Form of the exported state space.

    Parameters
    ----------
    outputs : str
        ``measured`` (as each sensor measures), ``displacement``, ``velocity`` or ``acceleration``.
    residual : str
        Residual flexibility as ``dynamics`` (proper) or as ``feedthrough``.
    pade_order : int
        Order of the Pade approximant of known delays; 0 omits them.
    sample_time_s : float
        0 for a continuous model, else the sample time of a discrete one (zero-order hold).
    ensemble : int
        Number of members of the posterior to write besides.
    files : tuple of str
        Files for other modal software, written with the fit: ``modes.csv``, ``modes.xlsx``, ``modes.unv`` (data sets
        55), ``frf.unv`` (data sets 58).

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.ExportOptions(outputs="displacement", sample_time_s=1e-4)
    ExportOptions(outputs='displacement', residual='dynamics', pade_order=0, sample_time_s=0.0001, ensemble=0, files=())
    """

    __pydantic_config__ = STRICT

    outputs: Literal["measured", "displacement", "velocity", "acceleration"] = "measured"
    residual: Literal["dynamics", "feedthrough"] = "dynamics"
    pade_order: CountOrNone = 0
    sample_time_s: NotNegative = 0.0
    ensemble: CountOrNone = 0
    files: tuple[Literal["modes.csv", "modes.xlsx", "modes.unv", "frf.unv"], ...] = ()

    def __post_init__(self) -> None:
        check_values(self)
