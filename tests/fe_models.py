"""Models that several tests of the FE stage use."""

import numpy as np
from scipy import io, sparse

from frf_ipz.fe.kinds.beam import BeamFile, BeamOptions, build_beam
from frf_ipz.fe.model_file import read_model
from frf_ipz.fe.model_options import DampingSection, ModelSection
from frf_ipz.structure import Geometry, StructuralModel

ALUMINIUM = {
    "length_m": 0.4995,
    "elements": 20,
    "formulation": "timoshenko",
    "youngs_modulus_Pa": 69e9,
    "density_kg_m3": 2690.0,
    "poisson_ratio": 0.33,
    "width_m": 25.33e-3,
    "thickness_m": 5.1e-3,
}
BEAM_TEXT = """
[model]
kind = "beam"
name = "beam"
[damping]
modal_ratio = 0.001
[beam]
length_m = 0.5
elements = 20
youngs_modulus_Pa = 69e9
density_kg_m3 = 2690.0
poisson_ratio = 0.33
width_m = 0.025
thickness_m = 0.005
left = "clamped"
"""
LUMPED_TEXT = """
[model]
kind = "lumped"
name = "frame"
[lumped]
direction = "x"
[[lumped.mass]]
node = 1
mass_kg = 2.0
[[lumped.mass]]
node = 2
mass_kg = 3.0
[[lumped.spring]]
id = "k1"
nodes = [0, 1]
stiffness_N_m = 4e5
damping_Ns_m = 3.0
[[lumped.spring]]
id = "k2"
nodes = [1, 2]
stiffness_N_m = 1e5
"""
MATRICES_TEXT = """
[model]
kind = "matrices"
name = "exported"
[matrices]
mass = "M.mtx"
stiffness = "K.mtx"
dofs = "dofs.csv"
"""


def beam(modal_ratio=None, **changes):
    """A beam of aluminium, changed by options of `[beam]`."""
    damping = None if modal_ratio is None else DampingSection(modal_ratio=(modal_ratio,))
    options = BeamOptions(**{**ALUMINIUM, **changes})
    return build_beam(BeamFile(model=ModelSection(kind="beam", name="beam"), beam=options, damping=damping))


def read_text_model(folder, text):
    """The model of a `model.toml` with this text."""
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    return read_model(path)


def export(folder, model, *, numbers=None):
    """Write the free DOFs of a model as an FE program would; `numbers` gives nodes other numbers."""
    places = {int(node): place for node, place in zip(model.geometry.nodes, model.geometry.coordinates_m, strict=True)}
    rows = ["node,direction,x_m,y_m,z_m"]
    for dof in model.dofs:
        node = dof.node if numbers is None else numbers[dof.node]
        rows.append(f"{node},{dof.direction}," + ",".join(repr(float(x)) for x in places[dof.node]))
    (folder / "dofs.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    io.mmwrite(folder / "M.mtx", sparse.coo_array(model.mass), symmetry="symmetric", precision=17)
    io.mmwrite(folder / "K.mtx", sparse.coo_array(model.stiffness), symmetry="symmetric", precision=17)
    (folder / "model.toml").write_text(MATRICES_TEXT, encoding="utf-8")
    return folder / "model.toml"


def structural_model(mass, stiffness, dofs, *, damping=None, modal_damping=(), coordinates_m=None, fixed=None):
    """A model from plain matrices."""
    order = len(dofs)
    nodes = np.array(sorted({dof.node for dof in dofs}))
    return StructuralModel(
        name="plain",
        kind="matrices",
        all_dofs=tuple(dofs),
        fixed=np.zeros(order, bool) if fixed is None else fixed,
        mass_all=sparse.csr_array(mass),
        stiffness_all=sparse.csr_array(stiffness),
        damping_all=sparse.csr_array((order, order)) if damping is None else sparse.csr_array(damping),
        modal_damping=np.array(modal_damping, dtype=float),
        geometry=Geometry(
            nodes=nodes,
            coordinates_m=np.zeros((len(nodes), 3)) if coordinates_m is None else coordinates_m,
            lines=np.zeros((0, 2), int),
        ),
    )
