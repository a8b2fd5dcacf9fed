"""Which sensors may weigh something that nobody has stated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from frf_ipz.quantities import FrfQuantity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from frf_ipz.dofs import Dof
    from frf_ipz.frf import FrfLabel
    from frf_ipz.ingest.test_file import Test


def unweighed_sensors(test: Test, labels: Sequence[FrfLabel]) -> tuple[Dof, ...]:
    """Name the accelerometers that sat on the structure during the whole test and whose mass is not stated.

    Parameters
    ----------
    test : Test
        States masses of sensors.
    labels : sequence of FrfLabel
        What was measured.

    Returns
    -------
    tuple of Dof
        Unsigned, each node once. Where sensors roved, none: their mass was in another place for each blow.
    """
    inputs = {label.input_dof for label in labels}
    measured = {(label.output_dof, label.input_dof) for label in labels}
    outputs = dict.fromkeys(label.output_dof for label in labels if label.quantity is FrfQuantity.ACCELERANCE)
    if len(measured) < len(inputs) * len({label.output_dof for label in labels}):
        return ()
    weighed = {node for node, mass in test.sensor_masses.items() if mass > 0}
    return tuple({dof.node: dof.unsigned for dof in outputs if dof.node not in weighed}.values())
