"""What a user may choose in ``[update]`` of a pipeline.

[Dorosti2018] M. Dorosti, R. H. B. Fey, M. F. Heertjes, H. Nijmeijer, Iterative Pole-Zero model updating: A combined
sensitivity approach, Control Engineering Practice 71, 2018, 164-174, doi:10.1016/j.conengprac.2017.11.002.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from frf_ipz.option_types import Count, CountOrNone, NotNegative, Positive, Seed, Truth
from frf_ipz.toml_files import STRICT, check_values


@dataclass(frozen=True, slots=True, kw_only=True)
class UpdateOptions:
    """How the reduced model is updated to the measured poles and zeros.

    Parameters
    ----------
    method : str
        ``minimal-change`` or ``ipz`` (as published), or the name of a further module in `updating.methods`.
    parameters : str
        ``parts`` (those of the FE model, and generic changes beyond) or ``diagnosis`` (what a diagnosis has found, and
        nothing else; needs ``[diagnose] apply = true``).
    mass : bool
        Let the masses of all parts change too, and not only those at single nodes (minimal-change).
    damping : bool
        Change the damping after the stiffness.
    max_iterations : int, optional
        Largest number of iterations; by default that of the method.
    alpha : float
        Regularisation of ``ipz`` where the normal matrix is ill-conditioned, eq. (15) of [Dorosti2018].
    beta : float
        Step of ``ipz``, eq. (19).
    delta : float
        Stop of ``ipz``, eq. (20).
    delta_damping : float
        Stop of ``ipz`` when it changes the damping.
    expand : bool
        Where the update is more than 1 dB off at measured points that it is not given, expand the measured shapes over
        the model in its place, if each point then follows better from the others (minimal-change).
    pair_again : bool
        Pair with the model after a first update too, where that gives measured modes other counterparts or sure ones,
        and update further if that brings the model nearer to the measured FRFs (minimal-change).
    cross_sensitivities : bool
        Use the off-diagonal blocks of eq. (14) (``ipz``).
    ensemble : int
        Number of models drawn from the posterior (minimal-change), from which the bands of predictions follow.
    seed : int
        Seed of the draws.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.UpdateOptions(mass=True, ensemble=50).method
    'minimal-change'
    """

    __pydantic_config__ = STRICT

    method: str = "minimal-change"
    parameters: Literal["parts", "diagnosis"] = "parts"
    mass: Truth = False
    damping: Truth = True
    max_iterations: Count | None = None
    alpha: NotNegative = 0.1
    beta: Positive = 0.3
    delta: NotNegative = 1e-3
    delta_damping: NotNegative = 0.1
    expand: Truth = True
    pair_again: Truth = True
    cross_sensitivities: Truth = True
    ensemble: CountOrNone = 200
    seed: Seed = 0

    def __post_init__(self) -> None:
        check_values(self)
