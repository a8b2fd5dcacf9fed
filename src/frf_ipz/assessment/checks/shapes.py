"""What is asked of a test of modes, which has no FRF: whether the updated model has the measured shapes.

The limits of MAC are those of practice ([Allemang2003]): above 0.9 two shapes are taken for the same, below 0.6 not.

[Allemang2003] R. J. Allemang, The modal assurance criterion: twenty years of use and abuse, Sound and Vibration 37 (8),
2003, 14-23.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.assessment.assessment import Check, Verdict
from frf_ipz.identification.results.shapes import mode_shapes
from frf_ipz.modes import modal_assurance
from frf_ipz.pairing.model_roots import model_shapes
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from frf_ipz.assessment.evidence import Evidence

SAME_SHAPE, OTHER_SHAPE = 0.9, 0.6


def no_frfs(evidence: Evidence) -> Iterator[Check]:
    """Say what cannot be asked, because no FRF was measured.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One.
    """
    if evidence.point_deviation is not None:
        return
    yield Check(
        name="measured FRFs",
        verdict=Verdict.WITH_CARE,
        says="the test has modes and no FRFs: amplitude, phase, zeros, residual terms and the band of the prediction "
        "cannot be compared with a measurement, and the level of the prediction rests on the mass of the model",
        advice="measure one FRF at least, best at a point of interest, and name it as [predict] reference",
    )


def agreement(evidence: Evidence) -> Iterator[Check]:
    """Compare the shapes of the paired modes, which are no targets of the update.

    Parameters
    ----------
    evidence : Evidence
        The run.

    Yields
    ------
    Check
        One, where modes are paired and have a shape.
    """
    measured = mode_shapes(evidence.fit)
    targets = [(place, pair.measured) for place, pair in enumerate(evidence.pairs.targets) if pair.kind == "pole"]
    if not targets or len(measured.dofs) < 2:
        return
    updated = evidence.updated_model
    computed = model_shapes(updated.model, measured.dofs)
    after = updated.after[[place for place, _ in targets]]
    nearest = np.argmin(np.abs(np.abs(computed.values)[None] - np.abs(after)[:, None]), axis=1)
    assurance = modal_assurance(measured.shapes, computed.amplitudes.T)
    values = assurance[[mode for _, mode in targets], nearest]
    worst = int(np.argmin(values))
    value, hertz = float(values[worst]), float(measured.natural_frequency_hz[targets[worst][1]])
    verdict = Verdict.USABLE if value >= SAME_SHAPE else Verdict.WITH_CARE
    yield Check(
        name="measured shapes",
        verdict=Verdict.NOT_USABLE if value < OTHER_SHAPE else verdict,
        figure=value,
        limit=SAME_SHAPE,
        unit="MAC",
        where=f"{hertz:.4g} Hz",
        says=f"MAC between measured and updated shapes at {counted(len(measured.dofs), 'DOF')} is {value:.2f} at worst "
        f"({hertz:.4g} Hz, {len(targets)} paired modes)",
        advice=""
        if value >= SAME_SHAPE
        else "look at DOFs and signs of the sensors, and for what the model leaves out",
    )
