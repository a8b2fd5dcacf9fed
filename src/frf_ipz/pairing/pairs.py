"""What pairing gives: every measured pole and zero against its counterpart in the model, with the reason."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from frf_ipz.display import Drawn, Tabulated
from frf_ipz.frf import FrfLabel


class PairVerdict(Enum):
    """Result of pairing a pole or zero.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> pairs = frf_ipz.pair_roots(fit, reduced_model)
    >>> sum(row.verdict is frf_ipz.PairVerdict.PAIRED for row in pairs.rows)
    6
    """

    PAIRED = "paired"
    MISSING_IN_MODEL = "missing in the model"
    MISSING_IN_MEASUREMENT = "missing in the measurement"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """One measured pole or zero and its counterpart.

    Parameters
    ----------
    kind : str
        ``pole`` or ``zero``.
    frf : int
        Which FRF a zero belongs to; -1 for poles.
    measured, computed : int
        Index among the fit's poles or zeros, and among the model's (by ascending modulus, per FRF for zeros); -1 where
        there is none.
    measured_value, computed_value : complex
        rad/s; NaN where there is none.
    distance : float
        Cost that the assignment minimised: of the frequency, and of the mode shape or the slope.
    verdict : PairVerdict
        Result of the pairing.
    reason : str
        Why, in words.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> pole = frf_ipz.pair_roots(fit, reduced_model).rows[0]
    >>> pole.kind, pole.verdict.value, round(abs(pole.measured_value) / (2 * np.pi), 2)
    ('pole', 'paired', 16.45)
    """

    kind: str
    frf: int
    measured: int
    computed: int
    measured_value: complex
    computed_value: complex
    distance: float
    verdict: PairVerdict
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RootCount:
    """How many measured poles or zeros the model has.

    Parameters
    ----------
    kind : str
        ``pole`` or ``zero``.
    paired, missing, undecided : int
        With a counterpart in the model; without one; and those of which the measurement does not tell: not
        identifiable, real, or with two counterparts that are as likely.

    Examples
    --------
    >>> import frf_ipz
    >>> frf_ipz.RootCount(kind="zero", paired=5, missing=1, undecided=4).text
    '5 of 10 measured zeros have a counterpart in the model, 1 is missing in it, 4 are undecided'
    """

    kind: str
    paired: int
    missing: int
    undecided: int

    @property
    def measured(self) -> int:
        """All that were measured."""
        return self.paired + self.missing + self.undecided

    @property
    def share(self) -> float:
        """Those with a counterpart, of all that were decided; 1 where none was."""
        decided = self.paired + self.missing
        return self.paired / decided if decided else 1.0

    @property
    def text(self) -> str:
        """The count in words."""
        words = [f"{self.paired} of {self.measured} measured {self.kind}s have a counterpart in the model"]
        words += [f"{self.missing} {'is' if self.missing == 1 else 'are'} missing in it"] if self.missing else []
        words += [f"{self.undecided} {'is' if self.undecided == 1 else 'are'} undecided"] if self.undecided else []
        return ", ".join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Pairs(Tabulated, Drawn):
    """All poles and zeros of measurement and model.

    Parameters
    ----------
    rows : tuple of Pair
        Poles first, then the zeros FRF by FRF.
    labels : tuple of FrfLabel
        What the FRFs connect to which zeros belong.
    warnings : tuple of str
        What the user has to know.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> lines = np.arange(5, 400.0, 0.5)
    >>> tip, middle = frf_ipz.Dof(11, "z"), frf_ipz.Dof(6, "z")
    >>> labels = [frf_ipz.FrfLabel(output, tip, frf_ipz.FrfQuantity.ACCELERANCE) for output in (middle, tip)]
    >>> values = frf_ipz.compute_frfs(beam, labels, 2j * np.pi * lines)[:, :, None]
    >>> frfs = frf_ipz.FrfSet.from_arrays(
    ...     lines, values, outputs=[middle, tip], inputs=[tip], variance=np.full(values.shape, 1e-4)
    ... )
    >>> fit = frf_ipz.fit_modes(frfs)
    >>> reduced_model = frf_ipz.reduce_model(fit, beam, points=["9:+z"])
    >>> pairs = frf_ipz.pair_roots(fit, reduced_model)
    >>> len(pairs.targets), pairs.targets[0].kind
    (6, 'pole')
    """

    rows: tuple[Pair, ...]
    labels: tuple[FrfLabel, ...] = ()
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        counts = [self.count(kind) for kind in ("pole", "zero")]
        return f"Pairs: {'; '.join(count.text for count in counts if count.measured or count.kind == 'pole')}"

    def count(self, kind: str) -> RootCount:
        """Count the measured poles or zeros by what pairing has found.

        Parameters
        ----------
        kind : str
            ``pole`` or ``zero``.

        Returns
        -------
        RootCount
            The one count of summary, page and checks.
        """
        verdicts = [row.verdict for row in self.rows if row.kind == kind and row.measured >= 0]
        paired, missing = (verdicts.count(verdict) for verdict in (PairVerdict.PAIRED, PairVerdict.MISSING_IN_MODEL))
        return RootCount(kind=kind, paired=paired, missing=missing, undecided=len(verdicts) - paired - missing)

    @property
    def targets(self) -> tuple[Pair, ...]:
        """The paired ones, which updating has to meet."""
        return tuple(row for row in self.rows if row.verdict is PairVerdict.PAIRED)
