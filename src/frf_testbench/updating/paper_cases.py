"""The two examples of [Dorosti2018] (doi:10.1016/j.conengprac.2017.11.002), set up as an update.

Section 4 is in rad/s, section 5 in Hz. The published epsilon of section 5 is that of eigenvalues divided by 2 pi, so
its delta is multiplied by (2 pi)^2 here, where everything is in rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from frf_ipz.arrays import ComplexArray
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.kinds.beam import BeamFile, BeamOptions, BeamSection, build_beam
from frf_ipz.fe.model_options import DampingSection, ModelSection
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_model
from frf_ipz.fe.response import model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.pencils import damped_zeros
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import underdamped_poles
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating.options import UpdateOptions
from frf_testbench.updating.synthetic_fit import Truth, fit_of_targets, in_order

TABLES = Path(__file__).parent / "paper_tables"
SHOWN = 0.1  # real part over modulus up to which a zero is an antiresonance
STATED_RATIO = 0.001  # of every mode, in the text of section 4
TABLE_5_RATIO = 0.00066  # of every mode, in the numbers of table 5, where the text says 0.001


@dataclass(frozen=True, kw_only=True)
class PaperCase:
    """An example: full and reduced model, targets as a fit, pairs, and the real structure where it is known."""

    full: StructuralModel
    reduced: ReducedModel
    fit: ModalFit
    pairs: Pairs
    point: FrfLabel
    truth: Truth | None = None

    @property
    def targets(self) -> ComplexArray:
        """Measured poles, then zeros, rad/s."""
        return np.concatenate([self.fit.model.poles, self.fit.zeros.values])


def section_4() -> PaperCase:
    """Set up the numerical example: a beam whose last element is another one than modelled."""
    nominal = _pinned_sliding()
    changed = BeamSection(elements=(12, 12), thickness_m=3.0e-2, width_m=1.333e-2)
    truth = Truth(_pinned_sliding((changed,)), np.full(60, STATED_RATIO))
    band = 40 / (2 * np.pi), 5000 / (2 * np.pi)
    dofs = tuple(f"{node}:z" for node in (3, 4, 5, 7, 9, 11))
    reduced = _reduced(nominal, dofs, "3:z", "3:z", "4:z", "7:z", band)
    label = FrfLabel(parse_dof("4:z"), parse_dof("3:z"), FrfQuantity.RECEPTANCE)
    zeros = truth.zeros(label)
    zeros = zeros[np.abs(zeros.real) < SHOWN * np.abs(zeros)][:3]
    poles = underdamped_poles(truth.omega[:4] / (2 * np.pi), truth.damping[:4])
    fit = fit_of_targets(poles, zeros, label, band)
    return PaperCase(
        full=nominal,
        reduced=reduced,
        fit=fit,
        pairs=in_order(fit, model_poles(reduced)[:4], shown_zeros(reduced, label)[:3]),
        point=replace(label, output_dof=parse_dof("7:z")),
        truth=truth,
    )


def section_5(blow: str = "89:z") -> PaperCase:
    """Set up the experiment: the targets are those printed in table 5; node 88 or 89 was struck."""
    full = _beam(4, poisson_ratio=0.33, elements=100, formulation="timoshenko", left="clamped", ratio=TABLE_5_RATIO)
    band = 10.0, 700.0
    dofs = tuple(f"{node}:z" for node in (9, 29, 49, 69, int(blow.split(":")[0]), 101))
    reduced = _reduced(full, dofs, "101:z", blow, "101:z", "49:z", band)
    label = FrfLabel(parse_dof("101:z"), parse_dof(blow), FrfQuantity.ACCELERANCE)
    printed = table(5)
    values = 2 * np.pi * (printed.experimental_real + 1j * printed.experimental_imag).to_numpy()
    is_pole = (printed.kind == "pole").to_numpy()
    fit = fit_of_targets(values[is_pole], values[~is_pole], label, band)
    return PaperCase(
        full=full,
        reduced=reduced,
        fit=fit,
        pairs=in_order(fit, model_poles(reduced)[:4], shown_zeros(reduced, label)[:3]),
        point=replace(label, output_dof=parse_dof("49:z")),
    )


def published(section: int, delta: float, **others: object) -> UpdateOptions:
    """Give the settings of a section; delta in its units."""
    if section == 4:
        return replace(UpdateOptions(method="ipz", delta=delta, damping=False), **others)
    hertz = (2 * np.pi) ** 2
    options = UpdateOptions(method="ipz", beta=1.0, delta=delta * hertz, delta_damping=0.1 * hertz)
    return replace(options, **others)


def table(number: int) -> pd.DataFrame:
    """Read a table of the paper."""
    return pd.read_csv(TABLES / f"dorosti2018_table{number}.csv", comment="#")


def shown_zeros(model: ReducedModel, label: FrfLabel) -> ComplexArray:
    """Give the zeros that a measurement shows as antiresonances, by ascending imaginary part, rad/s."""
    rows = model.row(label.output_dof), model.row(label.input_dof)
    roots = damped_zeros(model.mass, model.damping, model.stiffness, *rows).values
    shown = roots[(roots.imag > 0) & (np.abs(roots.real) < SHOWN * np.abs(roots))]
    return shown[np.argsort(shown.imag)]


def _pinned_sliding(section: tuple[BeamSection, ...] = ()) -> StructuralModel:
    ends = {"left": "pinned", "right": "sliding"}
    return _beam(1, elements=12, formulation="euler-bernoulli", section=section, ratio=STATED_RATIO, **ends)


def _beam(table_number: int, *, ratio: float, **options: object) -> StructuralModel:
    values = table(table_number).set_index("property")["value"]
    beam = BeamOptions(
        youngs_modulus_Pa=float(values["youngs_modulus"]),
        density_kg_m3=float(values["mass_density"]),
        thickness_m=float(values["thickness"]),
        width_m=float(values["width"]),
        length_m=float(values["length"]),
        **options,
    )
    return build_beam(
        BeamFile(model=ModelSection(kind="beam", name="beam"), damping=DampingSection(modal_ratio=(ratio,)), beam=beam)
    )


def _reduced(
    model: StructuralModel,
    dofs: tuple[str, ...],
    residual: str,
    actuator: str,
    sensor: str,
    point: str,
    band_hz: tuple[float, float],
) -> ReducedModel:
    return reduce_model(
        model,
        ReduceOptions(modes=5, dofs=dofs, residual_flexibility=(residual,)),
        actuators=[parse_dof(actuator)],
        sensors=[parse_dof(sensor)],
        points=[parse_dof(point)],
        band_hz=band_hz,
    )
