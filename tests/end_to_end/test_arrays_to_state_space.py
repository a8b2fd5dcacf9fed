"""Arrays in memory to a state space without a file: matrices as FE programs have them, against the machine's FRFs."""

import numpy as np
import pytest

import frf_ipz
from fe_models import beam

LINES_HZ = np.arange(30.0, 700.0, 1.0)  # beyond the unstable poles, at 15 Hz: a fit knows none inside its band
OUTPUTS, INPUTS, POINT = ["21:+z", "12:+z"], ["18:+z", "6:+z"], "15:+z"
SOFT = 0.97  # of the machine's stiffness: the model's
WITHIN_DB = 0.2  # at the point that was never measured
NEARER = 3.0  # times than the model that came in, where that is far off


def structure(kind, factor, ratio=0.004):
    """A beam with something that exported matrices have, its stiffness times a factor."""
    source = beam(left="clamped" if kind in {"massless", "complex"} else "free")
    names = [dof.name for dof in source.dofs]
    positions = dict(zip(source.geometry.nodes.tolist(), source.geometry.coordinates_m, strict=True))
    mass, stiffness = source.mass.toarray(), factor * source.stiffness.toarray()
    options = {"modal_damping": ratio}
    if kind == "negative stiffness":
        for label in ("5:z", "17:z"):
            stiffness[names.index(label), names.index(label)] -= 800.0
        options["allow_negative_stiffness"] = True
    elif kind == "massless":
        mass = np.diag([0.0 if name.endswith("ry") else 2 * mass[0, 0] for name in names])
    elif kind == "complex":
        stiffness, options = stiffness * (1 + 2j * ratio), {}
    elif kind == "multipliers":
        link = np.zeros((2, len(names)))
        for row, entries in enumerate(({"12:z": 1, "9:z": -1, "9:ry": 0.075}, {"12:ry": 1, "9:ry": -1})):
            for label, weight in entries.items():
                link[row, names.index(label)] = 1e6 * weight
        stiffness = np.block([[stiffness, link.T], [link, np.zeros((2, 2))]])
        mass, names = np.pad(mass, (0, 2)), [*names, "901:q", "902:q"]
        positions |= {901: (0, 0, 0), 902: (0, 0, 0)}
    elif kind == "mm-t-s":
        lengths = np.array([1e-3 if name.endswith("ry") else 1.0 for name in names])
        mass, stiffness = (1e-3 * matrix / np.outer(lengths, lengths) for matrix in (mass, stiffness))
        positions = {node: 1e3 * place for node, place in positions.items()}
        options["units"] = "mm-t-s"
    return frf_ipz.StructuralModel.from_matrices(mass, stiffness, dofs=names, coordinates=positions, **options)


def measure(machine):
    quantity = frf_ipz.FrfQuantity.ACCELERANCE
    labels = [
        frf_ipz.FrfLabel(frf_ipz.parse_dof(output), frf_ipz.parse_dof(force), quantity)
        for output in OUTPUTS
        for force in INPUTS
    ]
    values = frf_ipz.compute_frfs(machine, labels, 2j * np.pi * LINES_HZ).reshape(-1, 2, 2)
    noise = 0.003 * np.median(np.abs(values))
    scatter = np.random.default_rng(1).normal(size=(*values.shape, 2)).view(complex)[..., 0] / np.sqrt(2)
    return frf_ipz.FrfSet.from_arrays(
        LINES_HZ, values + noise * scatter, outputs=OUTPUTS, inputs=INPUTS, quantity="accelerance",
        variance=np.full(values.shape, noise**2),
    )  # fmt: skip


KINDS = [
    "negative stiffness",
    *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("massless", "complex", "multipliers", "mm-t-s")),
]


@pytest.mark.parametrize("kind", KINDS)
def test_arrays_become_a_state_space(kind):
    machine, model = structure(kind, 1.0), structure(kind, SOFT)
    campaign = frf_ipz.Campaign(measure(machine), model, points=[POINT], diagnose=frf_ipz.DiagnoseOptions(run="never"))
    system = campaign.run().state_space
    a, b, c, d = (np.asarray(matrix) for matrix in (system.A, system.B, system.C, system.D))
    row = list(system.output_labels).index(POINT)
    label = frf_ipz.FrfLabel(frf_ipz.parse_dof(POINT), frf_ipz.parse_dof(INPUTS[0]), frf_ipz.FrfQuantity.ACCELERANCE)
    for hertz in (1.0, 30.0, 100.0, 250.0):
        s = 2j * np.pi * hertz
        found = (c @ np.linalg.solve(s * np.eye(len(a)) - a, b) + d)[row, 0]
        exact, nominal = (frf_ipz.compute_frfs(which, [label], np.array([s]))[0, 0] for which in (machine, model))
        error, before = (abs(20 * np.log10(abs(value / exact))) for value in (found, nominal))
        assert error < max(WITHIN_DB, before / NEARER)
    poles = np.linalg.eigvals(a)
    assert np.count_nonzero(poles.real > 1.0) == (2 if kind == "negative stiffness" else 0)
