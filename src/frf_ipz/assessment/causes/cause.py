"""One mistake that may have been made, as a change of the computed modes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol, TypeAlias

import numpy as np

from frf_ipz.assessment.causes.modal_comparison import ComputedModes, MeasuredModes, log_likelihood

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray, ComplexArray
    from frf_ipz.dofs import AnyDof
    from frf_ipz.structure import StructuralModel


EXPECTED_COST = 2 * np.log(2)  # of a datum whose error is drawn from Cauchy's distribution: the mean of log(1 + x^2)


@dataclass(frozen=True, kw_only=True, eq=False)
class Situation:
    """What is known when a cause is looked for.

    Parameters
    ----------
    measured : MeasuredModes
        The measurement.
    computed : ComputedModes
        Elastic modes of the FE model as the user handed it in.
    model : StructuralModel
        The FE model.
    test_file, model_file : str
        Names of the files that a mistake may stand in.
    is_recorded : bool
        The FRFs were estimated from columns of recordings; else the test names them in ``[[frf]]``.
    """

    measured: MeasuredModes
    computed: ComputedModes
    model: StructuralModel
    test_file: str
    model_file: str
    is_recorded: bool = True

    @cached_property
    def channels(self) -> dict[AnyDof, str]:
        """Name of the channel of each sensor, by its unsigned DOF."""
        names: dict[AnyDof, str] = {}
        for label in self.measured.labels:
            names.setdefault(label.output_dof.unsigned, label.output_channel or str(label.output_dof))
        return names

    def key_of(self, side: str, channel: str, key: str) -> str:
        """Name the key of the test in which something is said of a channel.

        Parameters
        ----------
        side : str
            ``output`` or ``input``.
        channel : str
            Its name in the labels.
        key : str
            ``dof`` or ``unit``.

        Returns
        -------
        str
            Its section, the channel and the key.
        """
        if self.is_recorded:
            return f"[[channel]] column = '{channel}': {key}"
        return f"[[frf]] of {channel}: {f'{side}_dof (or in its file)' if key == 'dof' else key}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cause:
    """A mistake, and what the computed modes are once it is taken back.

    Parameters
    ----------
    says : str
        The mistake and what to write instead.
    file, line_or_key : str
        Where it stands.
    frequency_factor : float
        The right frequencies over the computed ones.
    gain : complex or (n_frfs,) array
        What channels show over what the computed modes give.
    gained : (n_frfs,) bool array, optional
        The FRFs of these channels, which have one gain; all where it is left out.
    power : int
        The channels show this many derivatives more than they are said to.
    moved_outputs, moved_inputs : mapping of Dof to Dof
        Where sensors and excited DOFs of the labels really are; those that are not named are where they say.
    computed : ComputedModes, optional
        Modes of another model; those of the situation where it is left out.
    log_prior : float
        Log probability among the causes of its kind; 0 for the only one.
    """

    says: str
    file: str
    line_or_key: str
    frequency_factor: float = 1.0
    gain: complex | ComplexArray = 1.0
    gained: BoolArray | None = None
    power: int = 0
    moved_outputs: Mapping[AnyDof, AnyDof] = field(default_factory=dict)
    moved_inputs: Mapping[AnyDof, AnyDof] = field(default_factory=dict)
    computed: ComputedModes | None = None
    log_prior: float = 0.0


NO_MISTAKE = Cause(says="", file="", line_or_key="")


class Causes(Protocol):
    """Causes of a kind; where there are very many, each is written out when it is asked for."""

    def __len__(self) -> int:
        """Count them."""

    def __getitem__(self, number: int, /) -> Cause:
        """Give one."""


FindCauses: TypeAlias = Callable[[Situation], "Iterable[Cause] | Causes"]


def log_evidence(cause: Cause, situation: Situation) -> float:
    """Give the log likelihood of the measurement under a cause, with the cause's prior among its kind.

    Parameters
    ----------
    cause : Cause
        The cause.
    situation : Situation
        Measurement and model.

    Returns
    -------
    float
        Natural logarithm.
    """
    frequency_hz, products = changed_modes(cause, situation)
    return log_likelihood(situation.measured, frequency_hz, products) + cause.log_prior


def explains(cause: Cause, situation: Situation) -> bool:
    """Tell whether the modes agree under a cause as those of a nearly right model do: the best of many may be bad.

    Parameters
    ----------
    cause : Cause
        The cause.
    situation : Situation
        Measurement and model.

    Returns
    -------
    bool
        True where the cost is at most what is expected of errors as large as their scales.
    """
    measured = situation.measured
    cost = cause.log_prior - log_evidence(cause, situation)
    return bool(cost <= EXPECTED_COST * (measured.products.size + len(measured.frequency_hz)))


def changed_modes(cause: Cause, situation: Situation) -> tuple[np.ndarray, np.ndarray]:
    """Give the computed modes as the measurement would show them under a cause.

    Parameters
    ----------
    cause : Cause
        The cause.
    situation : Situation
        Measurement and model.

    Returns
    -------
    pair of arrays
        (n_modes,) frequencies, Hz, and (n_modes, n_frfs) complex products of shapes.
    """
    computed = cause.computed or situation.computed
    frequency_hz = computed.frequency_hz * cause.frequency_factor
    products = computed.products(situation.measured.labels, cause.moved_outputs, cause.moved_inputs)
    gain = cause.gain if cause.gained is None else np.where(cause.gained, cause.gain, 1.0)
    return frequency_hz, products * gain * (2j * np.pi * frequency_hz[:, None]) ** cause.power
