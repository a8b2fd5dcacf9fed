"""What a user may choose in ``[diagnose]`` of a pipeline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from frf_ipz.arguments import as_path
from frf_ipz.option_types import NotNegative, Seed, Truth
from frf_ipz.toml_files import STRICT, check_values

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_FRFS = (
    "a diagnosis compares FRFs, and a test of kind 'modes' has none: masses, springs and joints that are missing, what "
    "depends on the level, gains and delays of sensors cannot be told from modes; 'run' says which modes have no "
    "counterpart in the model; measure FRFs, or take [diagnose] apply out"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnoseOptions:
    """What may be missing, and what a nominal model may be wrong by without anything missing.

    A tolerance is a half width: what it stands for has the standard deviation of a value that is uniform between minus
    and plus the tolerance, which is the tolerance over the square root of 3.

    Parameters
    ----------
    run : str
        When a run looks for a cause: ``auto``, where model and measurement differ by more than noise and tolerances;
        ``always``; ``never``.
    seconds : float, optional
        Wall time of the search, s; where nothing is stated, 60 in a run, and no limit where a diagnosis is asked for.
    apply : bool
        The finding flows on into updating and prediction.
    effects : tuple of str
        Search for these effects only, force laws among them; all of the contract's table where it is empty.
    extra_effects : tuple of str
        Further effects and force laws as ``file.py:ClassName``.
    stiffness_tolerance : float
        Half width of the relative deviation of local stiffness, 1; that of local mass is half of it.
    frequency_tolerance : float
        Half width of the relative deviation of natural frequencies beyond what local stiffness explains, 1.
    damping_tolerance : float
        Half width of the relative deviation of each modal damping ratio, 1.
    gain_tolerance : float
        Half width of the relative deviation of each channel's gain, 1.
    position_tolerance_m_per_m : float
        Half width of the deviation of positions of sensors and excited points, m per m of the structure's extent.
    angle_tolerance_deg : float
        Half width of the deviation of the direction of each sensor and impact, degrees; of use where the model moves
        in several directions.
    seed : int, optional
        Has no effect, since nothing is drawn at random; accepted, with a warning, for files of earlier versions.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.DiagnoseOptions(effects=("added_mass",), stiffness_tolerance=0.01).effects
    ('added_mass',)
    """

    __pydantic_config__ = STRICT

    run: Literal["auto", "always", "never"] = "auto"
    seconds: NotNegative | None = None
    apply: Truth = False
    effects: tuple[str, ...] = ()
    extra_effects: tuple[str, ...] = ()
    stiffness_tolerance: NotNegative = 1e-3
    frequency_tolerance: NotNegative = 1e-3
    damping_tolerance: NotNegative = 0.3
    gain_tolerance: NotNegative = 5e-3
    position_tolerance_m_per_m: NotNegative = 1e-3
    angle_tolerance_deg: NotNegative = 2.0
    seed: Seed | None = None

    def __post_init__(self) -> None:
        check_values(self)

    def effect_files(self, folder: str | Path) -> tuple[Path, ...]:
        """List the user's own files of effects, each once.

        Parameters
        ----------
        folder : str or Path
            Where paths start.

        Returns
        -------
        tuple of Path
            They need not be there.
        """
        return tuple(dict.fromkeys(as_path(folder) / reference.rpartition(":")[0] for reference in self.extra_effects))
