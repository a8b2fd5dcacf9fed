"""Which effects to search for: those of the catalogue that a user selected, and their own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.finder import read_class, shipped_effects
from frf_ipz.diagnosis.nonlinear.laws.finder import shipped_laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pathlib import Path

    from frf_ipz.diagnosis.options import DiagnoseOptions


def select_effects(options: DiagnoseOptions, folder: Path) -> dict[str, Effect]:
    """Select the effects to search for, without force laws.

    Parameters
    ----------
    options : DiagnoseOptions
        Which ones.
    folder : Path
        Where paths of users' files start.

    Returns
    -------
    dict of str to Effect
        By name, those of the contract first.

    Raises
    ------
    InputError
        If an effect or a file is not known, or a class in it is no effect.
    """
    shipped = shipped_effects()
    known = (*shipped, *shipped_laws())
    for name in options.effects:
        if name not in known:
            raise InputError(f"[diagnose] effects names '{name}', which is no effect; {did_you_mean(name, known)}")
    selected = {name: effect for name, effect in shipped.items() if not options.effects or name in options.effects}
    for reference in options.extra_effects:
        effect_class = read_class(reference, folder, (Effect, Law))
        if issubclass(effect_class, Effect):
            selected[effect_class.name] = effect_class()
    return selected
