"""What an FRF is the ratio of: receptance, mobility or accelerance; and the SI units that follow.

All values inside the program are SI. An FRF of the quantity q is the receptance times ``s**q.power``.
"""

from __future__ import annotations

from enum import Enum

from frf_ipz.errors import QuantityError, did_you_mean


class FrfQuantity(Enum):
    """The kind of response in an FRF (response per force or moment).

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.FrfQuantity("mobility").power, frf_ipz.FrfQuantity.MOBILITY.response
    (1, 'velocity')
    """

    RECEPTANCE = "receptance"
    MOBILITY = "mobility"
    ACCELERANCE = "accelerance"

    @property
    def power(self) -> int:
        """The power of s that makes this quantity out of a receptance: 0, 1 or 2."""
        return list(FrfQuantity).index(self)

    @property
    def response(self) -> str:
        """The response that it is a ratio of: displacement, velocity or acceleration."""
        return RESPONSES[self.power]

    def unit(self, output_direction: str = "z", input_direction: str = "z") -> str:
        """SI unit of an FRF between two directions, for labels and metadata.

        Parameters
        ----------
        output_direction, input_direction : str
            ``x``, ``y``, ``z``, or ``rx``, ``ry``, ``rz`` for rotations and moments.

        Returns
        -------
        str
            For example ``m/s^2/N``.

        Examples
        --------
        >>> FrfQuantity.ACCELERANCE.unit()
        'm/s^2/N'
        """
        force = "(N m)" if input_direction.startswith("r") else "N"
        return f"{self.response_unit(output_direction)}/{force}"

    def response_unit(self, direction: str = "z") -> str:
        """SI unit of the response along a direction.

        Parameters
        ----------
        direction : str
            As for `unit`.

        Returns
        -------
        str
            For example ``m/s^2``.
        """
        length = "rad" if direction.startswith("r") else "m"
        return f"{length}{('', '/s', '/s^2')[self.power]}"


RESPONSES = ("displacement", "velocity", "acceleration")
RECIPROCALS = {  # force per response, and what it is the reciprocal of
    "dynamic_stiffness": FrfQuantity.RECEPTANCE,
    "impedance": FrfQuantity.MOBILITY,
    "apparent_mass": FrfQuantity.ACCELERANCE,
}


def as_quantity(quantity: FrfQuantity | str) -> FrfQuantity:
    """Take a quantity of FRFs by its name.

    Parameters
    ----------
    quantity : FrfQuantity or str
        Such as ``"accelerance"``.

    Returns
    -------
    FrfQuantity
        The quantity.

    Raises
    ------
    QuantityError
        If there is none of that name.
    """
    try:
        return FrfQuantity(quantity)
    except ValueError:
        known = [kind.value for kind in FrfQuantity]
        raise QuantityError(f"'{quantity}' is no quantity of FRFs; {did_you_mean(str(quantity), known)}") from None


def frf_quantity_of(response: str) -> FrfQuantity:
    """Return the FRF quantity whose response is measured.

    Parameters
    ----------
    response : str
        ``displacement``, ``velocity`` or ``acceleration``.

    Returns
    -------
    FrfQuantity
        Receptance, mobility or accelerance.
    """
    return list(FrfQuantity)[RESPONSES.index(response)]
