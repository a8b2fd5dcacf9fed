"""Which effects and force laws to look for: those of the catalogue that a user chose, and their own."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from frf_ipz.diagnosis.catalogue.effect import Effect
from frf_ipz.diagnosis.catalogue.finder import read_class, shipped_effects
from frf_ipz.diagnosis.nonlinear.laws.finder import select_laws, shipped_laws
from frf_ipz.diagnosis.nonlinear.laws.law import Law
from frf_ipz.diagnosis.options import DiagnoseOptions
from frf_ipz.errors import InputError, did_you_mean


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectCatalogue:
    """What a diagnosis looks for.

    Parameters
    ----------
    options : DiagnoseOptions
        Which effects, and files with further ones.
    folder : Path
        Where paths of users' files start.
    own : tuple of Effect or Law
        Further ones as objects.
    """

    options: DiagnoseOptions = field(default_factory=DiagnoseOptions)
    folder: Path = field(default_factory=Path)
    own: tuple[Effect | Law, ...] = ()

    def effects(self) -> dict[str, Effect]:
        """Give the effects to look for, force laws apart.

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
        for name in self.options.effects:
            if name not in known:
                raise InputError(f"[diagnose] effects names '{name}', which is no effect; {did_you_mean(name, known)}")
        further = {extra.name: extra for extra in self._further() if isinstance(extra, Effect)}
        chosen = self.options.effects or shipped
        return {name: effect for name, effect in shipped.items() if name in chosen} | further

    def laws(self) -> tuple[Law, ...]:
        """Give the force laws to look for.

        Returns
        -------
        tuple of Law
            Possibly none.

        Raises
        ------
        InputError
            If a user's file cannot be read.
        """
        return (*select_laws(self.options), *(extra for extra in self._further() if isinstance(extra, Law)))

    def _further(self) -> tuple[Effect | Law, ...]:
        classes = [read_class(reference, self.folder, (Effect, Law)) for reference in self.options.extra_effects]
        return (*(extra() for extra in classes), *self.own)
