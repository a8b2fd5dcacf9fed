"""Compare `ipz` as published, `minimal-change` and the trivial answer on the two examples of Dorosti et al. (2018).

``frf-testbench paper``; it takes half a minute. Section 4 has a known truth, so the point of interest can be judged
there; of section 5 only the poles and zeros of table 5 are known.
"""

from __future__ import annotations

from time import process_time

import numpy as np
import pandas as pd

from frf_ipz.arrays import ComplexArray, FloatArray, IntArray
from frf_ipz.fe.response import compute_frfs
from frf_ipz.prediction.agreement import compare_frfs, shift_to_measured_poles
from frf_ipz.structure import ReducedModel
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_ipz.updating.updated_model import UpdatedModel
from frf_testbench.updating.paper_cases import (
    PaperCase,
    build_section_4,
    build_section_5,
    find_antiresonances,
    published_options,
    read_table,
)

BAND_RAD_S = np.linspace(40.0, 3900.0, 4000)  # section 4: where the paper compares FRFs


def print_comparison() -> None:
    """Print the tables."""
    with pd.option_context("display.width", 200, "display.max_columns", 20, "display.float_format", "{:.5g}".format):
        print("Section 4 (poles and zeros in rad/s)\n", compare_section_4().to_string(), "\n")
        for struck_dof, location in (
            ("89:z", "44 cm, as the text says"),
            ("88:z", "43.5 cm, as the table's zeros say"),
        ):
            print(
                f"Section 5, table 5 (Hz), the impact at {location}\n", compare_section_5(struck_dof).to_string(), "\n"
            )
        print(
            "Location of the impact: misfit to the three numerical zeros of table 5\n",
            compare_impact_locations().to_string(),
        )
        print(f"Smallest misfit at {fit_impact_location_cm():.2f} cm from the clamp")


def compare_section_4() -> pd.DataFrame:
    """Tabulate one row a method: how it ended and how good the point of interest is."""
    case = build_section_4()
    rows = {"nominal": judge_model(case, case.reduced_model)}
    rows["measured poles, nominal shapes"] = judge_model(case, shift_to_measured_poles(case.pairs, case.reduced_model))
    for name, options, by_element in (
        ("ipz, delta 1e-5", published_options(4, 1e-5), False),
        ("ipz, delta 1e-1", published_options(4, 1e-1), False),
        ("minimal-change, any stiffness", UpdateOptions(), False),
        ("minimal-change, elements", UpdateOptions(), True),
    ):
        start = process_time()
        basis = make_structural_basis(case.full_model, case.reduced_model) if by_element else None
        updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=options, basis=basis)
        rows[name] = judge_model(case, updated.model, updated) | {"cpu_s": process_time() - start}
    return pd.DataFrame(rows).T


def judge_model(case: PaperCase, model: ReducedModel, updated: UpdatedModel | None = None) -> dict[str, float]:
    """Judge a model by its FRF and its zeros at the point of interest, and an update by its targets."""
    if case.true_modes is None:
        raise ValueError("the truth of this example is not known: only section 4 has one")
    s = np.asarray(1j * BAND_RAD_S, np.complex128)
    agreement = compare_frfs(case.true_modes.receptance(s, case.point)[:, None], compute_frfs(model, [case.point], s))
    true_zeros = case.true_modes.zeros(case.point)
    is_antiresonance = np.abs(true_zeros.real) < 0.1 * np.abs(true_zeros)
    true_zeros = true_zeros[(true_zeros.imag < BAND_RAD_S[-1]) & is_antiresonance]
    zeros = find_antiresonances(model, case.point)[: len(true_zeros)]
    row = {
        "dB": float(agreement.median_db[0]),
        "X_S": float(agreement.shape[0]),
        "X_A": float(agreement.amplitude[0]),
        "zeros_%": worst_percent(zeros, true_zeros),
    }
    if updated is not None:
        matrix = model.stiffness
        row["iterations"] = float(updated.history.groupby("phase").iteration.max().sum())
        row["targets_%"] = worst_percent(updated.after, case.targets)
        row["epsilon"] = compute_epsilon(updated.after, case.targets)
        row["eta"] = float(np.linalg.norm(matrix - matrix.T, 2) / np.linalg.norm(matrix + matrix.T, 2))
    return row


def compare_section_5(struck_dof: str) -> pd.DataFrame:
    """Put table 5 side by side: one row a pole or zero, Hz."""
    case, printed = build_section_5(struck_dof), read_table(5)
    columns: dict[str, pd.Series | FloatArray] = {
        "kind": printed.kind,
        "experimental": printed.experimental_imag,
        "numerical": printed.numerical_imag,
    }
    columns["numerical here"] = np.array([pair.computed_value.imag for pair in case.pairs.targets]) / (2 * np.pi)
    columns["ipz, paper"] = printed.updated_imag
    for name, options in (("ipz", published_options(5, 1e-3)), ("minimal-change", UpdateOptions())):
        updated = update_model(case.fit, case.reduced_model, pairs=case.pairs, options=options)
        counts = updated.history.groupby("phase", sort=False).iteration.max()
        hertz = updated.after / (2 * np.pi)
        columns[f"{name}, {' + '.join(str(count) for count in counts)} iterations"] = hertz.imag
        columns[f"{name}, real"] = hertz.real
    columns["experimental, real"], columns["ipz, paper, real"] = printed.experimental_real, printed.updated_real
    return pd.DataFrame(columns)


def compare_impact_locations() -> pd.DataFrame:
    """Compare the nominal zeros with those printed in table 5, for every node near the one of the text."""
    nodes = np.arange(84, 94)
    deviations = np.array([zero_deviations(node) for node in nodes.tolist()])
    columns = {"from_clamp_cm": location_cm(nodes), "zeros_rms_%": 100 * np.sqrt(np.mean(deviations**2, axis=1))}
    return pd.DataFrame(columns, index=pd.Index(nodes, name="node"))


def fit_impact_location_cm() -> float:
    """Fit the location of the impact to the printed zeros, between the nodes; zeros move linearly over one element."""
    nodes = np.array([88, 89])
    at_first, at_second = (zero_deviations(node) for node in nodes)
    slope = at_second - at_first
    fraction = -float(slope @ at_first) / float(slope @ slope)
    return float(np.interp(fraction, [0.0, 1.0], location_cm(nodes)))


def zero_deviations(node: int) -> FloatArray:
    """Give the relative deviation of each nominal zero from the printed one, (3,), if that node was struck."""
    printed = read_table(5).query("kind == 'zero'").numerical_imag.to_numpy()
    zeros = [
        pair.computed_value.imag / (2 * np.pi) for pair in build_section_5(f"{node}:z").pairs.targets if pair.frf >= 0
    ]
    return np.asarray(np.array(zeros) / printed - 1)


def location_cm(nodes: IntArray) -> FloatArray:
    """Give the distance of nodes from the clamp, cm."""
    return np.asarray(49.95 * (nodes - 1) / 100)


def worst_percent(computed: ComplexArray, target: ComplexArray) -> float:
    """Give the largest deviation in per cent of the modulus."""
    return float(100 * np.max(np.abs(computed - target) / np.abs(target)))


def compute_epsilon(computed: ComplexArray, target: ComplexArray) -> float:
    """Compute eq. (6) with the weights of eq. (7)."""
    weights = np.abs(computed).max() / np.abs(computed)
    return float(np.sum(np.abs(weights * (computed - target)) ** 2))
