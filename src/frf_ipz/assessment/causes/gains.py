"""A constant factor between measured and computed FRFs: of all, of one channel, of one excited point."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.causes.cause import Cause

if TYPE_CHECKING:
    from frf_ipz.arrays import BoolArray
    from frf_ipz.assessment.causes.cause import Situation

STANDARD_GRAVITY, POUND_FORCE, INCH = 9.80665, 4.4482216152605, 0.0254  # m/s^2, N, m: exact by definition
# What a channel shows over what is true, and how that comes about
OF_OUTPUTS = {
    1 / STANDARD_GRAVITY: "is in g, and is read as m/s^2: write unit = 'g_0'",
    STANDARD_GRAVITY: "is in m/s^2, and is read as g: write unit = 'm/s^2'",
    1e3: "is in thousandths (mm/s^2, mm/s, mV) and is read as the whole unit: write unit = 'mm/s^2', or its like",
    1e-3: "is read as thousandths of the unit that it has",
    1e6: "is in millionths (um) and is read as the whole unit: write unit = 'um', or its like",
    1e-6: "is read as millionths of the unit that it has",
    1 / INCH: "is in inches (in/s^2) and is read as metres: write unit = 'in/s^2', or its like",
    INCH: "is in metres and is read as inches",
}
OF_FORCE = {
    1 / POUND_FORCE: "is in lbf, and is read as N: write unit = 'lbf'",
    POUND_FORCE: "is in N, and is read as lbf: write unit = 'N'",
    1e-3: "is in kN, and is read as N: write unit = 'kN'",
    1e3: "is in mN or mV, and is read as N: correct its unit",
    1 / STANDARD_GRAVITY: "is in kgf, and is read as N: write unit = 'kgf'",
}
DERIVATIVES = {
    1: "shows one derivative more than its quantity says (an acceleration called velocity, or a velocity displacement)",
    -1: "shows one derivative less than its quantity says (a velocity called acceleration, or a displacement velocity)",
    2: "is an acceleration, and is called displacement",
    -2: "is a displacement, and is called acceleration",
}


def of_all_outputs(situation: Situation) -> Iterator[Cause]:
    """List factors that all responses have in common.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a factor.
    """
    prior = -np.log(len(OF_OUTPUTS))
    section = "[[channel]]" if situation.is_recorded else "[[frf]]"
    for gain, text in OF_OUTPUTS.items():
        says = f"every response {text}"
        yield _test_cause(situation, says, f"{section} unit of the outputs", gain=gain, log_prior=prior)


def of_the_force(situation: Situation) -> Iterator[Cause]:
    """List factors of the force.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a factor.
    """
    prior = -np.log(len(OF_FORCE))
    for factor, text in OF_FORCE.items():
        column = situation.measured.labels[0].input_channel or "of the input"
        says = f"the force {text}"
        key = situation.key_of("input", column, "unit")
        yield _test_cause(situation, says, key, gain=1 / factor, log_prior=prior)


def of_one_output(situation: Situation) -> Iterator[Cause]:
    """List factors of single channels.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a channel and factor.
    """
    channels = _channels(situation)
    if len(channels) < 2:
        return
    prior = -np.log(len(OF_OUTPUTS) * len(channels))
    for name, mask in channels.items():
        for gain, text in OF_OUTPUTS.items():
            says, key = f"the channel '{name}' {text}", situation.key_of("output", name, "unit")
            yield _test_cause(situation, says, key, gain=gain, gained=mask, log_prior=prior)


def of_signs(situation: Situation) -> Iterator[Cause]:
    """List reversed signs: of one sensor, of one excited point, of the force.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a sign.
    """
    channels, points = _channels(situation), _points(situation)
    prior = -np.log(len(channels) + len(points) + 1)
    for name, mask in channels.items():
        says = f"the sensor of '{name}' measures the other way round: turn the sign of its dof"
        key = situation.key_of("output", name, "dof")
        yield _test_cause(situation, says, key, gain=-1.0, gained=mask, log_prior=prior)
    for name, mask in points.items() if len(points) > 1 else ():
        says = f"the force at {name} acts the other way round: turn the sign of its dof"
        key = f"[[hit]], [[record]] or [[frf]] of {name}: dof"
        yield _test_cause(situation, says, key, gain=-1.0, gained=mask, log_prior=prior)
    if len(channels) > 1:
        says = "the force has the other sign: turn the signs of the dofs of all inputs, or of the force in the files"
        yield _test_cause(situation, says, "dof of the inputs", gain=-1.0, log_prior=prior)


def of_derivatives(situation: Situation) -> Iterator[Cause]:
    """List derivatives that all responses have more or less than their quantity says.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a number of derivatives.
    """
    section = "[[channel]]" if situation.is_recorded else "[[frf]]"
    for power, text in DERIVATIVES.items():
        key, prior = f"{section} quantity of the outputs", -np.log(len(DERIVATIVES))
        yield _test_cause(situation, f"every response {text}", key, power=power, log_prior=prior)


def _test_cause(
    situation: Situation,
    says: str,
    key: str,
    *,
    gain: complex = 1.0,
    gained: BoolArray | None = None,
    power: int = 0,
    log_prior: float = 0.0,
) -> Cause:
    return Cause(
        says=says,
        file=situation.test_file,
        line_or_key=key,
        gain=gain,
        gained=gained,
        power=power,
        log_prior=float(log_prior),
    )


def _channels(situation: Situation) -> dict[str, BoolArray]:
    """Give which FRFs each output channel is in, by its name."""
    names = [label.output_channel or str(label.output_dof) for label in situation.measured.labels]
    return _where(names)


def _points(situation: Situation) -> dict[str, BoolArray]:
    """Give which FRFs each excited DOF is in, by its name."""
    names = [str(label.input_dof) for label in situation.measured.labels]
    return _where(names)


def _where(names: list[str]) -> dict[str, BoolArray]:
    distinct, number = np.unique(np.array(names), return_inverse=True)
    return {name: number == np.searchsorted(distinct, name) for name in dict.fromkeys(names)}
