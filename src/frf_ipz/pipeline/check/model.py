"""What an FE model weighs, how large it is, and where its first frequencies are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.errors import NumericalError
from frf_ipz.fe.eigen import solve_modes
from frf_ipz.fe.global_motions import AXES, rigid_body_motions
from frf_ipz.pipeline.check.look import Look
from frf_ipz.plotting.wording import number
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.structure import StructuralModel

FREQUENCIES = 6  # elastic ones, that are listed
RIGID_MOTIONS = 6


def look_at_model(model: StructuralModel) -> Look:
    """Say what a model is: mass, size, first frequencies.

    Parameters
    ----------
    model : StructuralModel
        The FE model.

    Returns
    -------
    Look
        Lines; that the modes cannot be computed is an open point, as a run ends there.
    """
    frequencies, open_points = _describe_frequencies(model)
    return Look(
        open_points=open_points,
        lines=(
            f"model       {model.name} ({model.kind}), {counted(len(model.dofs), 'free DOF')}",
            f"  mass      {_describe_mass(model)}",
            *([] if model.geometry.is_schematic else [f"  size      {_describe_size(model)}"]),
            f"  modes     {frequencies}",
            *(f"  note      {note}" for note in model.notes),
        ),
    )


def _describe_mass(model: StructuralModel) -> str:
    """State the mass that moves with the whole structure along each axis, that of held DOFs included."""
    motions = rigid_body_motions(model.all_dofs, model.geometry)[:, :3]
    masses = np.sum(motions * np.asarray(model.mass_all @ motions), axis=0)
    moving = [(axis, float(mass)) for axis, mass in zip(AXES, masses, strict=True) if mass > 0]
    if not moving:
        return "none along x, y or z"
    if len({number(mass, 3) for _, mass in moving}) == 1:
        return f"{number(moving[0][1])} kg"
    return ", ".join(f"{number(mass)} kg along {axis}" for axis, mass in moving)


def _describe_size(model: StructuralModel) -> str:
    extent = np.ptp(model.geometry.coordinates_m, axis=0)
    along = [f"{number(float(size))} m along {axis}" for axis, size in zip(AXES, extent, strict=True) if size > 0]
    return ", ".join(along) or "a single point"


def _describe_frequencies(model: StructuralModel) -> tuple[str, tuple[str, ...]]:
    """Give the first frequencies, and what stands in the way of them."""
    try:
        modes = solve_modes(model, n_modes=min(FREQUENCIES + RIGID_MOTIONS, model.n_modes))
    except NumericalError as error:
        return "cannot be computed, see below", (f"modes of the model cannot be computed: {error}",)
    elastic = modes.natural_frequency_hz[modes.natural_frequency_hz > 0]
    text = " ".join(number(hz) for hz in elastic[:FREQUENCIES]) + " Hz"
    unstable = -2 * np.pi * modes.natural_frequency_hz[modes.natural_frequency_hz < 0]
    rigid = len(modes.natural_frequency_hz) - len(elastic) - len(unstable)
    if len(unstable):
        rates = ", ".join(f"+-{number(float(rate))}" for rate in np.sort(unstable))
        text += f", besides {counted(len(unstable), 'mode')} of negative stiffness with poles at {rates} rad/s"
    return (f"{text}, besides {counted(rigid, 'rigid-body motion')}" if rigid else text), ()
