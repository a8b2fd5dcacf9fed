"""``model.toml`` to start from: filled in where matrices are there, else a skeleton that is commented out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.pipeline.init.text import HEAD, guessed, quoted
from frf_ipz.unit_systems import SYSTEMS

if TYPE_CHECKING:
    from frf_ipz.pipeline.init.folder_contents import FolderContents

SKELETON = """
# Take the '#' away from one of the three kinds, write your numbers, and name the file in pipeline.toml.
# [model]
# kind = "beam"                 # beam | lumped | matrices
# name = {name}

# [damping]
# modal_ratio = 0.001           # one ratio for all modes, or a list; or rayleigh = {{ alpha_1_s = 0.1, beta_s = 1e-6 }}

# A straight beam along x, bending in z; nodes are 1 .. elements + 1 from the left. All in SI: m, Pa, kg/m^3.
# [beam]
# length_m = 0.5
# elements = 100
# width_m = 0.025
# thickness_m = 0.005
# youngs_modulus_Pa = 69e9
# density_kg_m3 = 2700.0
# poisson_ratio = 0.33
# left = "clamped"              # clamped | pinned | sliding | free
# right = "free"

# Point masses joined by springs, one direction; node 0 is the ground.
# [lumped]
# direction = "x"
# [[lumped.mass]]
# node = 1
# mass_kg = 6.5
# [[lumped.spring]]
# id = "k1"
# nodes = [0, 1]
# stiffness_N_m = 4.2e5

# Matrices that another FE program exported, in SI: kg, N/m.
# [matrices]
# mass = "M.mtx"
# stiffness = "K.mtx"
# dofs = "dofs.csv"             # in the order of the rows: node,direction,x_m,y_m,z_m
"""


def draft_model(contents: FolderContents) -> str:
    """Write a model for what a folder holds.

    Parameters
    ----------
    contents : FolderContents
        The folder.

    Returns
    -------
    str
        Text of ``model.toml``.
    """
    name = quoted(contents.folder.resolve().name)
    found = contents.model
    if not found.is_complete:
        return "# Written by 'frf-ipz init': a skeleton." + SKELETON.format(name=name)
    lines = [HEAD, "[model]", 'kind = "matrices"', f"name = {name}"]
    if not found.is_in_si:
        *systems, last = SYSTEMS
        lines.append(guessed('units = "SI"', f"what the deck is in: {', '.join(systems)} or {last}"))
    lines += ["", "[damping]"]
    lines.append(guessed("modal_ratio = 0.01", "one ratio for all modes, or a list; updated where measured"))
    lines += ["", "[matrices]", *_matrices(contents)]
    if found.rows is not None:
        rows = f"dofs = {quoted(contents.name(found.rows))}"
        lines.append(guessed(rows, "has other rows than the matrices") if "rows" in found.guessed else rows)
    if found.nodes is not None:
        nodes = f"nodes = {quoted(contents.name(found.nodes))}"
        lines.append(guessed(nodes, "counted from 1 in the file's order") if "nodes" in found.guessed else nodes)
    for group, parts in found.groups.items():
        lines += ["", "[[matrices.group]]", f"name = {quoted(group)}"]
        lines += [f"{kind} = {quoted(contents.name(parts[kind]))}" for kind in ("stiffness", "mass") if kind in parts]
    return "\n".join(lines) + "\n"


def _matrices(contents: FolderContents) -> list[str]:
    """Write the files of the matrices; what other models are there stands beside the stiffness."""
    found, lines = contents.model, []
    others = [contents.name(model.matrices["stiffness"]) for model in contents.models[1:] if model.has_both]
    for kind, unit in (("mass", "in kg"), ("stiffness", "in N/m"), ("damping", "in N s/m")):
        if kind not in found.matrices:
            continue
        comments = [unit] if found.is_in_si else []
        comments += ["told by the name of the file"] if kind in found.guessed and not found.is_in_si else []
        comments = ["told by its size"] if kind in found.variables else comments
        comments += [f"other models: {', '.join(others)}"] if others and kind == "stiffness" else []
        line = f"{kind} = {quoted(contents.name(found.matrices[kind]))}"
        lines.append(guessed(line, "; ".join(comments)) if comments else line)
    if found.variables:
        names = ", ".join(f"{kind} = {quoted(name)}" for kind, name in found.variables.items())
        lines.append(f"variables = {{ {names} }}")
    return lines
