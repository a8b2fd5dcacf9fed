"""Which sensors are left out, and which may weigh something that nobody has stated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from frf_ipz.dofs import node_dofs, parse_label
from frf_ipz.errors import InputError, did_you_mean
from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.ingest.campaign import VibrationTest


def unweighed_sensors(test: VibrationTest, labels: Sequence[FrfLabel]) -> tuple[Dof, ...]:
    """Name the accelerometers that sat on the structure during the whole test and whose mass is not stated.

    Parameters
    ----------
    test : VibrationTest
        States masses of sensors.
    labels : sequence of FrfLabel
        What was measured.

    Returns
    -------
    tuple of Dof
        Unsigned, each node once, ports left out. Where sensors roved, none: their mass was at another point for each
        record.
    """
    inputs = {label.input_dof for label in labels}
    measured = {(label.output_dof, label.input_dof) for label in labels}
    outputs = dict.fromkeys(label.output_dof for label in labels if label.quantity is FrfQuantity.ACCELERANCE)
    if len(measured) < len(inputs) * len({label.output_dof for label in labels}):
        return ()
    weighed = {node for node, mass in test.sensor_masses.items() if mass > 0}
    return tuple({dof.node: dof.unsigned for dof in node_dofs(outputs) if dof.node not in weighed}.values())


def without_sensors(test: VibrationTest, hidden: Sequence[str]) -> VibrationTest:
    """Leave the FRFs of some sensors out of a test; their recordings and known masses stay.

    Parameters
    ----------
    test : VibrationTest
        The test.
    hidden : sequence of str
        DOFs of the sensors, of whatever sign.

    Returns
    -------
    VibrationTest
        With the labels that are left.

    Raises
    ------
    InputError
        If no sensor sits at such a DOF, or none is left.
    """
    left_out = {parse_label(text).unsigned: text for text in hidden}
    names = {dof.unsigned: str(dof) for dof in test.output_dofs}
    for dof, text in left_out.items():
        if dof not in names:
            raise InputError(f"there is no sensor at '{text}'; {did_you_mean(text, names.values())}")
    labels = tuple(label for label in test.labels if label.output_dof.unsigned not in left_out)
    if test.modes is not None:
        seen = [place for place, dof in enumerate(test.modes.dofs) if dof.unsigned not in left_out]
        if seen:
            dofs = tuple(test.modes.dofs[place] for place in seen)
            return replace(test, modes=replace(test.modes, shapes=test.modes.shapes[seen], dofs=dofs), labels=labels)
    if not labels:
        raise InputError("this leaves no sensor; take one out of the list")
    return replace(test, labels=labels)
