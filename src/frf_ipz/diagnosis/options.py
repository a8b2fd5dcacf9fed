"""What a user may choose in ``[diagnose]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass

from frf_ipz.option_types import CountOrNone, NotNegative
from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnoseOptions:
    """What may be missing, and what a nominal model may be wrong by without anything missing.

    Parameters
    ----------
    apply : bool
        The finding flows on into updating and prediction.
    effects : tuple of str
        Search for these effects only, force laws among them; all of the contract's table where it is empty.
    extra_effects : tuple of str
        Further effects and force laws as ``file.py:ClassName``.
    stiffness_tolerance, frequency_tolerance : float
        Relative standard deviation of local stiffness, and of natural frequencies.
    damping_tolerance : float
        Relative tolerance of each modal damping ratio.
    gain_tolerance : float
        Relative tolerance of sensor gains.
    position_tolerance_m_per_m : float
        Tolerance of positions of sensors and excited points, as a part of the structure's length.
    seed : int
        Of everything that is drawn at random.
    """

    __pydantic_config__ = STRICT

    apply: bool = False
    effects: tuple[str, ...] = ()
    extra_effects: tuple[str, ...] = ()
    stiffness_tolerance: NotNegative = 1e-3
    frequency_tolerance: NotNegative = 1e-3
    damping_tolerance: NotNegative = 0.3
    gain_tolerance: NotNegative = 5e-3
    position_tolerance_m_per_m: NotNegative = 1e-3
    seed: CountOrNone = 0

    def __post_init__(self) -> None:
        check_values(self)
