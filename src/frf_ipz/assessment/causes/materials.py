"""Numbers of the FE model in a wrong unit, of another material, or with a slipped decimal point.

A factor k on the stiffness and m on the mass moves all frequencies by ``sqrt(k / m)`` and divides every product of mode
shapes by m: that tells which of the two is off, whatever the structure.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from frf_ipz.assessment.causes.cause import Cause
from frf_ipz.assessment.causes.modal_comparison import FREQUENCY_SCALE, computed_modes
from frf_ipz.errors import FrfIpzError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.kinds.beam import BeamFile, BeamOptions, BeamSection, build_beam
from frf_ipz.unit_systems import SI, SYSTEMS

if TYPE_CHECKING:
    from frf_ipz.assessment.causes.cause import Situation

Sized = TypeVar("Sized", BeamOptions, BeamSection)
MOST = 100.0  # a decimal point slipped by two places; what is further off is a unit
NEAR = 0.02  # of a factor that is known: the scatter of a good model


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A number of a model, and what the model's stiffness and mass make of it.

    Parameters
    ----------
    key : str
        Where it stands.
    what : str
        What it is, for a sentence.
    stiffness_power, mass_power : float
        Stiffness and mass go with these powers of it.
    units : tuple of (float, str)
        What it has to be multiplied by where it was written in a wrong unit, and in which.
    numbers : tuple of str
        Its keys in a beam: on springs, point masses, shear and rotary inertia the powers do not hold.
    is_plural : bool
        `what` is several.
    is_system : bool
        The units are systems, which ``[model] units`` names: rows of rotations have another factor.
    """

    key: str
    what: str
    stiffness_power: float
    mass_power: float
    units: tuple[tuple[float, str], ...]
    numbers: tuple[str, ...] = ()
    is_plural: bool = False
    is_system: bool = False

    def written_in(self, unit: str, factor: float) -> str:
        """Say that it is written in a unit, and what to do."""
        seem, them = ("seem", "them") if self.is_plural else ("seems", "it")
        remedy = f'set units = "{unit}" under [model]' if self.is_system else f"multiply {them} by {factor:g}"
        return f"{self.what} {seem} to be written in {unit}: {remedy}"


PASCAL = ((1e9, "GPa"), (1e6, "MPa (N/mm^2)"), (1e3, "kPa"))
METRE = ((1e-3, "mm"), (1e-2, "cm"), (0.0254, "inches"))
DENSITY = ((1e3, "g/cm^3"), (1e12, "t/mm^3"))
NUMBERS = {
    "beam": (
        Number(
            key="[beam] youngs_modulus_Pa",
            what="Young's modulus",
            numbers=("youngs_modulus_Pa",),
            stiffness_power=1,
            mass_power=0,
            units=PASCAL,
        ),
        Number(
            key="[beam] density_kg_m3",
            what="the density",
            numbers=("density_kg_m3",),
            stiffness_power=0,
            mass_power=1,
            units=DENSITY,
        ),
        Number(
            key="[beam] thickness_m",
            what="the thickness",
            numbers=("thickness_m",),
            stiffness_power=3,
            mass_power=1,
            units=METRE,
        ),
        Number(
            key="[beam] width_m",
            what="the width",
            numbers=("width_m",),
            stiffness_power=1,
            mass_power=1,
            units=METRE,
        ),
        Number(
            key="[beam] length_m",
            what="the length",
            numbers=("length_m",),
            stiffness_power=-3,
            mass_power=1,
            units=METRE,
        ),
        Number(
            key="[beam] length_m, width_m, thickness_m",
            what="all dimensions",
            is_plural=True,
            numbers=("length_m", "width_m", "thickness_m"),
            stiffness_power=1,
            mass_power=3,
            units=METRE,
        ),
    ),
    "lumped": (
        Number(
            key="[[lumped.spring]] stiffness_N_m",
            what="every stiffness",
            stiffness_power=1,
            mass_power=0,
            units=((1e3, "N/mm"), (1e-3, "kN/m read as N/m")),
        ),
        Number(
            key="[[lumped.mass]] mass_kg",
            what="every mass",
            stiffness_power=0,
            mass_power=1,
            units=((1e-3, "g"), (1e3, "t")),
        ),
    ),
    "matrices": (
        Number(
            key="[matrices] mass: [model] units",
            what="the mass matrix",
            stiffness_power=0,
            mass_power=1,
            units=((1e3, "t"), (1e-3, "g")),
        ),
        Number(
            key="[matrices] stiffness: [model] units",
            what="the stiffness matrix",
            stiffness_power=1,
            mass_power=0,
            units=((1e3, "N/mm"), (1e6, "kN/mm")),
        ),
        Number(
            key="[model] units",
            what="the matrices",
            is_plural=True,
            is_system=True,
            stiffness_power=1,
            mass_power=1,
            units=tuple((mass, name) for name, (_, mass, time) in SYSTEMS.items() if name != SI and time == 1.0),
        ),
    ),
}


def wrong_units(situation: Situation) -> Iterator[Cause]:
    """List numbers of the model in units that people use for them.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a number and unit.
    """
    numbers = NUMBERS.get(situation.model.kind, ())
    count = sum(len(number.units) for number in numbers)
    for number in numbers:
        for factor, unit in number.units:
            says = number.written_in(unit, factor)
            scaled = _scaled(situation, number, factor, says, -float(np.log(count)))
            cause = _rebuilt(scaled, situation, number.numbers, factor) if number.numbers else scaled
            common = scaled.frequency_factor
            if common != 1.0 and _moves_all(cause, situation, common):
                cause = replace(cause, says=f"{says} (all frequencies are off by the common factor {common:.4g})")
            yield cause


def _moves_all(cause: Cause, situation: Situation, factor: float) -> bool:
    """Tell whether all frequencies go with one factor: not where springs or point masses stay as they are."""
    if cause.computed is None:
        return True
    after, before = cause.computed.frequency_hz, situation.computed.frequency_hz
    count = min(len(after), len(before))
    return bool(np.all(np.abs(np.log(after[:count] / (factor * before[:count]))) < NEAR))


def wrong_values(situation: Situation) -> Iterator[Cause]:
    """List numbers of the model that are off by a factor which the frequencies tell.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a number and ratio of a measured and a computed frequency.
    """
    ratios = np.unique((situation.measured.frequency_hz[:, None] / situation.computed.frequency_hz).round(6))
    ratios = ratios[ratios > 0]  # a model a million times too stiff is off by no single number
    numbers = [
        number
        for number in NUMBERS.get(situation.model.kind, ())
        if number.stiffness_power != number.mass_power and "," not in number.key
    ]
    prior = -float(np.log(len(ratios) * len(numbers))) if numbers else 0.0
    for number in numbers:
        for ratio in ratios:
            factor = float(ratio) ** (2 / (number.stiffness_power - number.mass_power))
            is_scatter = abs(np.log(ratio)) < FREQUENCY_SCALE  # of a model that is nearly right
            if not 1 / MOST < factor < MOST or is_scatter:
                continue
            direction = "low" if factor > 1 else "high"
            times = max(factor, 1 / factor)
            says = (
                f"{number.what} seems {times:.3g} times too {direction}: all frequencies are off by the common factor "
                f"{ratio:.4g} (another material, or a slipped decimal point)"
            )
            yield _scaled(situation, number, factor, says, prior)


def time_unit(situation: Situation) -> Iterator[Cause]:
    """List units of the time column that are read as seconds.

    Parameters
    ----------
    situation : Situation
        Measurement and model.

    Yields
    ------
    Cause
        One a unit.
    """
    for factor, unit in ((1e-3, "ms"), (1e-6, "us")):
        says = f"the time is in {unit}, and is read as s: name its unit in the column's header, or write it in s"
        power = situation.measured.labels[0].quantity.power
        yield Cause(
            says=says,
            file=situation.test_file,
            line_or_key="the time column of the recordings",
            frequency_factor=factor,
            gain=factor ** (2 - power),
            log_prior=-float(np.log(2)),
        )


def _scaled(situation: Situation, number: Number, factor: float, says: str, log_prior: float) -> Cause:
    stiffness, mass = factor**number.stiffness_power, factor**number.mass_power
    return Cause(
        says=says,
        file=situation.model_file,
        line_or_key=number.key,
        frequency_factor=float(np.sqrt(stiffness / mass)),
        gain=1 / mass,
        log_prior=log_prior,
    )


def _rebuilt(cause: Cause, situation: Situation, numbers: tuple[str, ...], factor: float) -> Cause:
    """Take the modes from a beam that is built with other numbers; where there is none, the scaled ones stay."""
    file = situation.model.source
    if not isinstance(file, BeamFile):
        return cause
    beam = _resized(file.beam, numbers, factor)
    sections = tuple(_resized(section, numbers, factor) for section in beam.section)
    try:
        nominal = situation.model
        model = build_beam(replace(file, beam=replace(beam, section=sections))).with_ports(nominal.ports)
        modes = solve_modes(model, n_modes=min(len(situation.computed.frequency_hz) + 3, model.n_modes))
    except FrfIpzError:
        return cause
    return replace(cause, computed=computed_modes(modes), frequency_factor=1.0, gain=1.0)


def _resized(options: Sized, numbers: tuple[str, ...], factor: float) -> Sized:
    values = {name: getattr(options, name, None) for name in numbers}
    return replace(options, **{name: value * factor for name, value in values.items() if value is not None})
