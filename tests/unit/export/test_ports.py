"""Inputs and outputs carry their units, for rotations too."""

import numpy as np
import pytest

from frf_ipz.dofs import Dof
from frf_ipz.export.options import ExportOptions
from frf_ipz.export.ports import choose_ports
from frf_ipz.frf import FrfLabel
from frf_ipz.quantities import FrfQuantity

TURNED = FrfLabel(Dof(1, "ry"), Dof(2, "rz"), FrfQuantity.MOBILITY)


def test_rotations_have_moments_and_radians():
    ports = choose_ports((TURNED,), (Dof(3, "z"),), ExportOptions(), {})
    assert ports.input_units == ("N m",)
    assert [output.unit for output in ports.outputs] == ["rad/s", "m/s"]


def test_a_sensor_of_two_excitations_is_one_output_in_its_first_quantity():
    of_moment = FrfLabel(Dof(1, "ry"), Dof(4, "z"), FrfQuantity.RECEPTANCE)
    ports = choose_ports((TURNED, of_moment), (), ExportOptions(), {})
    assert [str(dof) for dof in ports.inputs] == ["2:+rz", "4:+z"]
    assert [output.quantity for output in ports.outputs] == [FrfQuantity.MOBILITY]


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_all_outputs_can_be_of_one_kind(quantity):
    ports = choose_ports((TURNED,), (Dof(3, "z"),), ExportOptions(outputs=quantity), {})
    powers = np.array([output.quantity.power for output in ports.outputs])
    assert np.all(powers == ("displacement", "velocity", "acceleration").index(quantity))
