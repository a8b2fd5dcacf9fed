"""Masses at single nodes that an update finds: what the structure carries there and its model lacks, or has too much.

Many nodes are asked at once, so that one counts only where as many nodes of nothing would hardly show one by chance.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from scipy.special import ndtri

from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.arrays import FloatArray
    from frf_ipz.updating.parameters import ParameterBasis

CHANCE = 0.05  # that of nodes without a mass any one is named
BAND = (0.05, 0.95)


COLUMNS = ("node", "mass_kg", "mass_kg_low", "mass_kg_high")


def find_local_masses(basis: ParameterBasis, draws: FloatArray) -> pd.DataFrame:
    """Find the nodes whose masses are surely off, the largest first.

    Parameters
    ----------
    basis : ParameterBasis
        Parameters of the update.
    draws : (m, p) array
        Of the parameters, from the posterior.

    Returns
    -------
    DataFrame
        One row a node: ``node``, ``mass_kg``, and the 90 % interval ``mass_kg_low``, ``mass_kg_high``, kg; none where
        no mass is surely off, or nothing was drawn.
    """
    places = np.array(list(basis.at_nodes), int)
    if not len(places) or len(draws) < 2:
        return pd.DataFrame(columns=list(COLUMNS))
    kilograms = draws[:, places] * basis.moving_kg
    means, stds = kilograms.mean(axis=0), kilograms.std(axis=0)
    is_sure = np.abs(means) > -ndtri(CHANCE / 2 / len(places)) * stds
    named = [place for place in np.argsort(-np.abs(means)) if is_sure[place]]
    ends = np.quantile(kilograms, BAND, axis=0)
    nodes = [str(basis.at_nodes[int(places[place])]) for place in named]
    values = (nodes, means[named], ends[0, named], ends[1, named])
    return pd.DataFrame(dict(zip(COLUMNS, values, strict=True)))


def local_mass_notes(masses: pd.DataFrame, *, n_without_counterpart: int = 0) -> tuple[str, ...]:
    """Say what a user has to know of masses at nodes.

    Parameters
    ----------
    masses : DataFrame
        As `find_local_masses` gives them.
    n_without_counterpart : int
        Measured poles that the model has none for: then masses may stand for what is missing.

    Returns
    -------
    tuple of str
        One sentence with all of them; none where there are none.
    """
    if not len(masses):
        return ()
    found = [
        f"{mass:+.2g} kg at node {node} (90 %: {low:+.2g} to {high:+.2g} kg)"
        for node, mass, low, high in masses[list(COLUMNS)].itertuples(index=False)
    ]
    doubt = ""
    if n_without_counterpart:
        poles = f"{counted(n_without_counterpart, 'measured pole')} {'have' if n_without_counterpart > 1 else 'has'}"
        doubt = f"; {poles} no counterpart, so that they may stand for something else that is missing"
    return (
        f"poles and zeros tell of {counted(len(found), 'mass', 'masses')} that the model lacks, or has too much of: "
        f"{', '.join(found)}; they are in the updated model, and a neighbouring node looks nearly alike{doubt}",
    )
