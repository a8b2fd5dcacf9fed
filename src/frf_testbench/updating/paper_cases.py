"""The two examples of [Dorosti2018] (doi:10.1016/j.conengprac.2017.11.002), set up as an update.

Section 4 is in rad/s, section 5 in Hz. The published epsilon of section 5 is that of eigenvalues divided by 2 pi, so
its delta is multiplied by (2 pi)^2 here, where everything is in rad/s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypedDict

import numpy as np
import pandas as pd

from frf_ipz.arrays import ComplexArray
from frf_ipz.dofs import parse_dof
from frf_ipz.fe.kinds.beam import BeamFile, BeamOptions, BeamSection, build_beam
from frf_ipz.fe.model_options import DampingSection, ModelSection
from frf_ipz.fe.reduction.options import ReduceOptions
from frf_ipz.fe.reduction.reduce import reduce_to_dofs
from frf_ipz.fe.response import model_poles
from frf_ipz.frf import FrfLabel
from frf_ipz.identification.modal_fit import ModalFit
from frf_ipz.numerics.pencils import damped_zeros
from frf_ipz.pairing.pairs import Pairs
from frf_ipz.quantities import FrfQuantity
from frf_ipz.rational import underdamped_poles
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating.options import UpdateOptions
from frf_testbench.updating.synthetic_fit import TrueModes, make_fit_of_targets, pair_in_order

TABLES = Path(__file__).parent / "paper_tables"
ANTIRESONANCE_LIMIT = 0.1  # real part over modulus up to which a zero is an antiresonance
STATED_RATIO = 0.001  # of every mode, in the text of section 4
TABLE_5_RATIO = 0.00066  # of every mode, in the numbers of table 5, where the text says 0.001


@dataclass(frozen=True, kw_only=True)
class PaperCase:
    """An example: full and reduced model, targets as a fit, pairs, and the real structure where it is known."""

    full_model: StructuralModel
    reduced_model: ReducedModel
    fit: ModalFit
    pairs: Pairs
    point: FrfLabel
    true_modes: TrueModes | None = None

    @property
    def targets(self) -> ComplexArray:
        """Measured poles, then zeros, rad/s."""
        return np.concatenate([self.fit.model.poles, self.fit.zeros.values])


def build_section_4() -> PaperCase:
    """Set up the numerical example: a beam whose last element is another one than modelled."""
    nominal_model = _build_pinned_sliding_beam()
    changed = BeamSection(elements=(12, 12), thickness_m=3.0e-2, width_m=1.333e-2)
    true_modes = TrueModes(_build_pinned_sliding_beam((changed,)), np.full(60, STATED_RATIO))
    band = 40 / (2 * np.pi), 5000 / (2 * np.pi)
    dofs = tuple(f"{node}:z" for node in (3, 4, 5, 7, 9, 11))
    reduced_model = _reduce(nominal_model, dofs, "3:z", "3:z", "4:z", "7:z", band)
    label = FrfLabel(parse_dof("4:z"), parse_dof("3:z"), FrfQuantity.RECEPTANCE)
    zeros = true_modes.zeros(label)
    zeros = zeros[np.abs(zeros.real) < ANTIRESONANCE_LIMIT * np.abs(zeros)][:3]
    poles = underdamped_poles(true_modes.omega[:4] / (2 * np.pi), true_modes.damping[:4])
    fit = make_fit_of_targets(poles, zeros, label, band)
    return PaperCase(
        full_model=nominal_model,
        reduced_model=reduced_model,
        fit=fit,
        pairs=pair_in_order(fit, model_poles(reduced_model)[:4], find_antiresonances(reduced_model, label)[:3]),
        point=replace(label, output_dof=parse_dof("7:z")),
        true_modes=true_modes,
    )


def build_section_5(struck_dof: str = "89:z") -> PaperCase:
    """Set up the experiment: the targets are those printed in table 5; node 88 or 89 was struck."""
    full_model = _build_beam(
        BeamOptions(**_read_rectangle(4), poisson_ratio=0.33, elements=100, formulation="timoshenko", left="clamped"),
        TABLE_5_RATIO,
    )
    band = 10.0, 700.0
    dofs = tuple(f"{node}:z" for node in (9, 29, 49, 69, int(struck_dof.split(":")[0]), 101))
    reduced_model = _reduce(full_model, dofs, "101:z", struck_dof, "101:z", "49:z", band)
    label = FrfLabel(parse_dof("101:z"), parse_dof(struck_dof), FrfQuantity.ACCELERANCE)
    printed = read_table(5)
    values = 2 * np.pi * (printed.experimental_real.to_numpy() + 1j * printed.experimental_imag.to_numpy())
    is_pole = (printed.kind == "pole").to_numpy()
    fit = make_fit_of_targets(values[is_pole], values[~is_pole], label, band)
    return PaperCase(
        full_model=full_model,
        reduced_model=reduced_model,
        fit=fit,
        pairs=pair_in_order(fit, model_poles(reduced_model)[:4], find_antiresonances(reduced_model, label)[:3]),
        point=replace(label, output_dof=parse_dof("49:z")),
    )


def published_options(section: int, delta: float) -> UpdateOptions:
    """Give the settings of a section; delta in its units."""
    if section == 4:
        return UpdateOptions(method="ipz", delta=delta, damping=False)
    hertz = (2 * np.pi) ** 2
    return UpdateOptions(method="ipz", beta=1.0, delta=delta * hertz, delta_damping=0.1 * hertz)


def read_table(number: int) -> pd.DataFrame:
    """Read a table of the paper."""
    return pd.read_csv(TABLES / f"dorosti2018_table{number}.csv", comment="#")


def find_antiresonances(model: ReducedModel, label: FrfLabel) -> ComplexArray:
    """Give the zeros that a measurement shows as antiresonances, by ascending imaginary part, rad/s."""
    rows = model.row(label.output_dof), model.row(label.input_dof)
    roots = damped_zeros(model.mass, model.damping, model.stiffness, *rows).values
    antiresonances = roots[(roots.imag > 0) & (np.abs(roots.real) < ANTIRESONANCE_LIMIT * np.abs(roots))]
    return antiresonances[np.argsort(antiresonances.imag)]


def _build_pinned_sliding_beam(section: tuple[BeamSection, ...] = ()) -> StructuralModel:
    beam = BeamOptions(
        **_read_rectangle(1),
        elements=12,
        formulation="euler-bernoulli",
        left="pinned",
        right="sliding",
        section=section,
    )
    return _build_beam(beam, STATED_RATIO)


class _Rectangle(TypedDict):
    """Material and dimensions of a uniform beam, as `BeamOptions` calls them."""

    youngs_modulus_Pa: float
    density_kg_m3: float
    thickness_m: float
    width_m: float
    length_m: float


def _read_rectangle(table_number: int) -> _Rectangle:
    values = read_table(table_number).set_index("property")["value"]
    return {
        "youngs_modulus_Pa": float(values["youngs_modulus"]),
        "density_kg_m3": float(values["mass_density"]),
        "thickness_m": float(values["thickness"]),
        "width_m": float(values["width"]),
        "length_m": float(values["length"]),
    }


def _build_beam(beam: BeamOptions, damping_ratio: float) -> StructuralModel:
    damping = DampingSection(modal_ratio=(damping_ratio,))
    return build_beam(BeamFile(model=ModelSection(kind="beam", name="beam"), damping=damping, beam=beam))


def _reduce(
    model: StructuralModel,
    dofs: tuple[str, ...],
    residual: str,
    actuator: str,
    sensor: str,
    point: str,
    band_hz: tuple[float, float],
) -> ReducedModel:
    return reduce_to_dofs(
        model,
        options=ReduceOptions(modes=5, dofs=dofs, residual_flexibility=(residual,)),
        actuators=[parse_dof(actuator)],
        sensors=[parse_dof(sensor)],
        points=[parse_dof(point)],
        band_hz=band_hz,
    )
