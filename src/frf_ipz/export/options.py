"""What a user may choose in ``[export]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from frf_ipz.errors import InputError
from frf_ipz.option_types import CountOrNone, Name, NotNegative
from frf_ipz.toml_files import STRICT, check_values

Response = Literal["displacement", "velocity", "acceleration"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """Form of the exported state space.

    Parameters
    ----------
    outputs : str or tuple of str
        ``measured`` (as each sensor measures), ``displacement``, ``velocity`` or ``acceleration``; or several of these
        three, which every output port then gives.
    ports : tuple of str
        Output DOFs and ports, in this order; all sensors and points of interest where empty. Every port of the FE model
        may be named.
    inputs : tuple of str
        Input DOFs and ports, in this order; all excited DOFs where empty. Every port of the FE model may be named.
    residual : str
        Residual flexibility as ``dynamics`` (proper) or as ``feedthrough``.
    pade_order : int
        Order of the Pade approximant of delays in continuous models; 0 omits those of channels. Sampled models need
        none: their delays are exact.
    delay_s : float
        Delay of the loop, at the inputs, s: exact where `sample_time_s` is given, else by a Pade approximant of
        `pade_order`.
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
    >>> frf_ipz.ExportOptions(outputs=["displacement", "velocity"], sample_time_s=1e-4).outputs
    ('displacement', 'velocity')
    """

    __pydantic_config__ = STRICT

    outputs: Literal["measured", "displacement", "velocity", "acceleration"] | tuple[Response, ...] = "measured"
    ports: tuple[Name, ...] = ()
    inputs: tuple[Name, ...] = ()
    residual: Literal["dynamics", "feedthrough"] = "dynamics"
    pade_order: CountOrNone = 0
    delay_s: NotNegative = 0.0
    sample_time_s: NotNegative = 0.0
    ensemble: CountOrNone = 0
    files: tuple[Literal["modes.csv", "modes.xlsx", "modes.unv", "frf.unv"], ...] = ()

    def __post_init__(self) -> None:
        check_values(self)
        for name in ("outputs", "ports", "inputs"):
            given = getattr(self, name)
            repeated = [] if isinstance(given, str) else [item for item in given if given.count(item) > 1]
            if repeated:
                raise InputError(f"{name} names '{repeated[0]}' twice; name it once")
        if self.outputs == ():
            raise InputError("outputs is empty; name at least one of displacement, velocity, acceleration")
        if self.delay_s and not self.sample_time_s and not self.pade_order:
            raise InputError(
                "delay_s of a continuous model needs pade_order, the order of the approximant, such as 2; or give "
                "sample_time_s, with which the delay is exact"
            )
