"""What an update may change, and how likely each change is: parameters with a Gaussian prior.

The metric of a minimal change is the prior's: a change is small where it is likely. Three kinds of parameters are
built here, and a diagnosis may bring its own.

- Parts of the FE model (elements, springs, groups; of assembled matrices, regions that fade into one another): the
  logarithm of a factor on each part's stiffness. A prior term
  common to all parts stands for a wrong modulus or thickness, terms whose correlation falls off with the distance for
  segments that are softer or stiffer than modelled.
- Every symmetric change of the reduced stiffness, relative to ``omega_i omega_j`` in mass-normalised modal
  coordinates: what the parts cannot express, and all there is where a model has no parts.
- Masses at nodes, which a structure has and its model lacks, or the other way round. A stiffness that moves the same
  poles and zeros bends the shapes between measured points otherwise. All nodes have one standard deviation, of which
  the data tell.
- Factors on the masses of the parts, where the user lets the mass change.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from frf_ipz.arguments import require_type
from frf_ipz.arrays import BoolArray, FloatArray, require_shape
from frf_ipz.display import Concise
from frf_ipz.dofs import Dof, as_dofs
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.numerics.pencils import undamped_poles
from frf_ipz.structure import ReducedModel, StructuralModel
from frf_ipz.updating.regions import Region, points_of_mass, reduced_regions, smooth_regions

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from frf_ipz.dofs import AnyDof

GLOBAL_STD = 0.1  # of the logarithm of a factor common to all parts: a wrong modulus or thickness
SEGMENT_STD = 0.05  # of each term with a correlation length
SEGMENT_LENGTHS = (0.05, 0.2)  # correlation lengths, as parts of the structure's extent
GENERIC_STD = 0.005  # of a relative change that no part expresses, beside parts
GENERIC_STD_ALONE = 0.05  # of the same where the model has no parts
SENSOR_KG = 2e-3  # of the mass of a sensor that the model does not contain: accelerometers weigh some grams
MASS_STD = 0.02  # masses are known better than stiffness
LOCAL_MASS_STD = MASS_STD / GLOBAL_STD * SEGMENT_STD * len(SEGMENT_LENGTHS) ** 0.5  # at one place, beside the mean
SCALE_UNCERTAINTY = 1.0  # standard deviation of the logarithm of each of these: the data may ask for others
SAME_POSITION = 1e-9  # of the variance, by which two parts at one position differ, so that it has a root
FREE_MODES = 24  # a change among higher modes hardly moves what was measured, where the band holds fewer
MOST_FREE_MODES = 48  # of a model with more modes in its basis: a change of each pair is a matrix to be kept


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class PriorTerm(Concise):
    """One independent contribution to the parameters: `std` times `root` times a vector of unit normal numbers.

    Parameters
    ----------
    name : str
        In words.
    root : (p, k) array
        Its covariance is ``std**2 root root^T``.
    std : float
        Standard deviation before the data are seen.
    scale_uncertainty : float
        Standard deviation of the logarithm of `std`; 0 fixes it.
    """

    name: str
    root: FloatArray
    std: float
    scale_uncertainty: float = SCALE_UNCERTAINTY

    def by_whitened(self, slopes: FloatArray) -> FloatArray:
        """Turn derivatives by parameters into those by this term's unit normal numbers, for a `std` of 1.

        Parameters
        ----------
        slopes : (n, p) array
            By the parameters.

        Returns
        -------
        (n, k) array
            ``slopes @ root``: most numbers move one parameter only.
        """
        is_used = self.root != 0.0
        if np.all(np.count_nonzero(is_used, axis=0) == 1):
            rows = np.argmax(is_used, axis=0)
            first = int(rows[0]) if len(rows) else 0
            is_run = np.array_equal(rows, np.arange(first, first + len(rows)))
            chosen = slopes[:, first : first + len(rows)] if is_run else np.take(slopes, rows, axis=1)
            return np.asarray(chosen * self.root[rows, np.arange(len(rows))])
        used = np.flatnonzero(is_used.any(axis=1))
        return np.asarray(slopes[:, used] @ self.root[used])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ParameterBasis(Concise):
    """Parameters of an update with their prior.

    Parameters
    ----------
    names : tuple of str
        One a parameter.
    mass, damping, stiffness : (p, r, r) array
        Change of the reduced matrices for one unit of each parameter.
    logarithmic : (p,) bool array
        True where the parameter is the logarithm of a factor: its contribution is then ``exp(theta) - 1`` times the
        matrices, else theta times.
    terms : tuple of PriorTerm
        Their sum is the prior; its mean is 0.
    regions : tuple of Region
        Regions of the first `len(regions)` parameters; empty for parameters without a location.
    is_from_diagnosis : bool
        True where a diagnosis has named these parameters; only then do methods with generic parameters of their own
        use them instead.
    attached : tuple of int
        Parameters that are masses of what is attached to the structure: none is less than nothing.
    at_nodes : mapping of int to int
        Parameters that are masses at nodes, as parts of the mass that moves, and which nodes.
    moving_kg : float
        That mass, kg; 0 without such parameters.

    Raises
    ------
    ShapeError
        If shapes disagree.

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
    >>> basis = frf_ipz.make_structural_basis(beam, reduced_model)
    >>> float(basis.amounts(np.zeros(len(basis.names))).max())
    0.0
    """

    names: tuple[str, ...]
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    logarithmic: BoolArray
    terms: tuple[PriorTerm, ...]
    regions: tuple[Region, ...] = ()
    is_from_diagnosis: bool = False
    attached: tuple[int, ...] = ()
    at_nodes: Mapping[int, int] = field(default_factory=dict)
    moving_kg: float = 0.0

    def __post_init__(self) -> None:
        count = len(self.names)
        for name in ("mass", "damping", "stiffness"):
            require_shape(f"the parameters' {name}", getattr(self, name), (count, None, None))
        require_shape("the marks of logarithmic parameters", self.logarithmic, (count,))
        for term in self.terms:
            require_shape(f"the prior term '{term.name}'", term.root, (count, None))

    def amounts(self, theta: FloatArray) -> FloatArray:
        """Factors with which the matrices of the parameters are added.

        Parameters
        ----------
        theta : (..., p) array
            Parameters.

        Returns
        -------
        (..., p) array
            Factors on the matrices.
        """
        return np.where(self.logarithmic, np.expm1(np.where(self.logarithmic, theta, 0.0)), theta)

    def without(self, places: Sequence[int]) -> ParameterBasis:
        """Leave out parameters, as masses that weigh nothing.

        Parameters
        ----------
        places : sequence of int
            Which parameters; none of those of `regions`.

        Returns
        -------
        ParameterBasis
            Without them.
        """
        stays = ~np.isin(np.arange(len(self.names)), places)
        numbers = np.cumsum(stays) - 1
        terms = [replace(term, root=term.root[stays]) for term in self.terms]
        return replace(
            self,
            names=tuple(name for name, is_kept in zip(self.names, stays, strict=True) if is_kept),
            mass=_kept(self.mass, stays),
            damping=_kept(self.damping, stays),
            stiffness=_kept(self.stiffness, stays),
            logarithmic=self.logarithmic[stays],
            terms=tuple(replace(term, root=term.root[:, term.root.any(axis=0)]) for term in terms if term.root.any()),
            attached=tuple(int(numbers[place]) for place in self.attached if stays[place]),
            at_nodes={int(numbers[place]): node for place, node in self.at_nodes.items() if stays[place]},
        )

    @property
    def is_of_nodes(self) -> BoolArray:
        """Which terms are of masses at nodes alone, (t,)."""
        is_node = np.isin(np.arange(len(self.names)), list(self.at_nodes))
        return np.array([term.root[is_node].any() and not term.root[~is_node].any() for term in self.terms], bool)

    def slopes(self, theta: FloatArray) -> FloatArray:
        """Give the derivative of `amounts`.

        Parameters
        ----------
        theta : (p,) array
            Parameters.

        Returns
        -------
        (p,) array
            Derivatives.
        """
        return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, theta, 0.0)), 1.0)


def generic_basis(model: ReducedModel, *, std: float = GENERIC_STD_ALONE, common: bool = True) -> ParameterBasis:
    """All symmetric changes of the reduced stiffness, relative in mass-normalised modal coordinates.

    Parameters
    ----------
    model : ReducedModel
        The nominal model.
    std : float
        Of an entry of the change relative to ``omega_i omega_j``; of one on the diagonal it is larger by sqrt 2, so
        that the prior is the same in all rotated coordinates.
    common : bool
        Add a term for a factor on the whole stiffness.

    Returns
    -------
    ParameterBasis
        One parameter an entry; rigid-body modes do not change, as changes are relative to the stiffness.
    """
    poles = undamped_poles(model.mass, model.stiffness)
    n_free = max(FREE_MODES, min(model.n_modes, MOST_FREE_MODES))
    omega = np.sqrt(np.maximum(poles.values.real, 0.0))[:n_free]
    shares = omega * (model.mass @ poles.right_vectors.real)[:, :n_free]
    first, second = np.triu_indices(len(omega))
    stiffness = np.empty((len(first), len(shares), len(shares)))
    for matrix, i, j in zip(stiffness, first.tolist(), second.tolist(), strict=True):
        np.outer(shares[:, i], shares[:, j], out=matrix)
        if i != j:
            matrix += matrix.T.copy()
    diagonal, unchanged = first == second, np.zeros(stiffness.shape)  # which takes no memory: nothing is written there
    roots = [
        PriorTerm(name="any change of the stiffness", root=np.diag(np.where(diagonal, np.sqrt(2.0), 1.0)), std=std)
    ]
    if common:
        roots.insert(
            0, PriorTerm(name="a factor on the stiffness", root=np.asarray(diagonal[:, None], float), std=GLOBAL_STD)
        )
    return ParameterBasis(
        names=tuple(f"stiffness {i + 1}-{j + 1}" for i, j in zip(first, second, strict=True)),
        mass=unchanged,
        damping=unchanged,
        stiffness=stiffness,
        logarithmic=np.zeros(len(first), bool),
        terms=tuple(roots),
    )


@on_one_thread
def make_structural_basis(
    fe_model: StructuralModel, reduced_model: ReducedModel, *, mass: bool = False, sensors: Sequence[AnyDof | str] = ()
) -> ParameterBasis:
    """Factors on parts of the FE model, masses of sensors and at nodes, and generic changes that parts cannot express.

    Parameters
    ----------
    fe_model : StructuralModel
        The FE model.
    reduced_model : ReducedModel
        Its reduced model.
    mass : bool
        Let the masses of the parts change too.
    sensors : sequence of Dof or str
        Sensors of unknown mass that are attached during the whole test: the mass is a parameter too.

    Returns
    -------
    ParameterBasis
        With regions in the place of parts where the model has none, or only one; with generic parameters alone where
        its matrices do not say where nodes are.

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
    >>> basis = frf_ipz.make_structural_basis(beam, reduced_model)
    >>> len(basis.names), basis.names[0]
    (41, 'stiffness of element 1')
    """
    require_type("fe_model", fe_model, StructuralModel)
    require_type("reduced_model", reduced_model, ReducedModel)
    heavy_sensors = as_dofs(sensors, name="sensors")
    regions = reduced_regions(fe_model, reduced_model)
    has_parts = len(regions) > 1
    regions = regions if has_parts else smooth_regions(fe_model, reduced_model)
    if not regions:
        basis = generic_basis(reduced_model)
    else:
        basis = _part_basis(regions, stiffness=True)
        if not has_parts:  # regions that fade into one another are no parts to be named
            basis = replace(basis, regions=())
        if mass:
            basis = join_bases(basis, _part_basis(regions, stiffness=False))
        basis = join_bases(basis, generic_basis(reduced_model, std=GENERIC_STD, common=False))
        points = points_of_mass(fe_model, reduced_model)
        weighed = {dof.node for dof in heavy_sensors if isinstance(dof, Dof)}  # what is there is that of the sensor
        points = {node: rows for node, rows in points.items() if node not in weighed}
        basis = join_bases(basis, _node_mass_basis(points, reduced_model))
    return join_bases(basis, _sensor_basis(reduced_model, heavy_sensors)) if heavy_sensors else basis


def join_bases(first: ParameterBasis, second: ParameterBasis) -> ParameterBasis:
    """Join two sets of parameters with independent priors.

    Parameters
    ----------
    first, second : ParameterBasis
        Parameters of the same reduced model.

    Returns
    -------
    ParameterBasis
        The parameters of the first, then those of the second.
    """
    n_first, n_second = len(first.names), len(second.names)
    terms = [replace(term, root=np.pad(term.root, ((0, n_second), (0, 0)))) for term in first.terms]
    terms += [replace(term, root=np.pad(term.root, ((n_first, 0), (0, 0)))) for term in second.terms]
    return ParameterBasis(
        names=first.names + second.names,
        mass=_stacked(first.mass, second.mass),
        damping=_stacked(first.damping, second.damping),
        stiffness=_stacked(first.stiffness, second.stiffness),
        logarithmic=np.concatenate([first.logarithmic, second.logarithmic]),
        terms=tuple(terms),
        regions=first.regions,
        is_from_diagnosis=first.is_from_diagnosis or second.is_from_diagnosis,
        attached=(*first.attached, *(n_first + place for place in second.attached)),
        at_nodes={**first.at_nodes, **{n_first + place: node for place, node in second.at_nodes.items()}},
        moving_kg=first.moving_kg or second.moving_kg,
    )


def _stacked(first: FloatArray, second: FloatArray) -> FloatArray:
    """One after the other."""
    return _copied([*first, *second], first.shape[1:])


def _kept(matrices: FloatArray, stays: BoolArray) -> FloatArray:
    """Those that stay: without a copy where they are a run, or nothing but zeros from the first that is left out on."""
    places = np.flatnonzero(stays)
    first = int(places[0]) if len(places) else 0
    is_run = bool(stays[first : first + len(places)].all())
    if is_run or not matrices[int(np.argmin(stays)) :].any():
        return matrices[first if is_run else 0 :][: len(places)]
    return _copied([matrices[place] for place in places], matrices.shape[1:])


def _copied(matrices: Sequence[FloatArray], shape: tuple[int, ...]) -> FloatArray:
    """Give a stack of matrices; those that are zero take no memory, as nothing is written into them."""
    result = np.zeros((len(matrices), *shape))
    for copy, matrix in zip(result, matrices, strict=True):
        if np.any(matrix):
            copy[:] = matrix
    return result


def unwhiten(terms: tuple[PriorTerm, ...], scales: FloatArray, whitened: FloatArray) -> FloatArray:
    """Turn whitened parameters into parameters.

    Parameters
    ----------
    terms : tuple of PriorTerm
        Prior of the parameters.
    scales : (t,) array
        Standard deviations of the terms.
    whitened : (..., k) array
        All terms' unit normal numbers.

    Returns
    -------
    (..., p) array
        Parameters.
    """
    root = np.hstack([scale * term.root for scale, term in zip(scales, terms, strict=True)])
    return np.asarray(whitened @ root.T)


def _sensor_basis(model: ReducedModel, sensors: Sequence[AnyDof]) -> ParameterBasis:
    """Mass of each sensor, kg; without those that measure a rotation."""
    dofs = [dof for dof in dict.fromkeys(dof.unsigned for dof in sensors) if not dof.direction.startswith("r")]
    rows = np.array([model.row(dof) for dof in dofs]).reshape(len(dofs), len(model.dofs))
    mass = np.einsum("ki,kj->kij", rows, rows)
    return ParameterBasis(
        names=tuple(f"mass of the sensor at {dof.name}" for dof in dofs),
        mass=mass,
        damping=np.zeros_like(mass),
        stiffness=np.zeros_like(mass),
        logarithmic=np.zeros(len(dofs), bool),
        terms=(PriorTerm(name="mass of sensors", root=np.eye(len(dofs)), std=SENSOR_KG),),
        attached=tuple(range(len(dofs))),
    )


def _node_mass_basis(points: Mapping[int, FloatArray], model: ReducedModel) -> ParameterBasis:
    """Mass at each node, as a part of the mass that moves: all together about as far off as masses are.

    Squares of mass-normalised shapes add up to the number of modes over the mass that moves, where it is spread evenly:
    at most nodes, but for those beside supports and on light parts.
    """
    mass = np.array([rows.T @ rows for rows in points.values()]).reshape(-1, len(model.mass), len(model.mass))
    squares = np.einsum("nij,ij->n", mass, np.linalg.inv(model.mass))
    moving = len(model.mass) / float(np.median(squares)) if len(squares) else 0.0
    unchanged = np.zeros_like(mass)
    term = PriorTerm(name="masses at nodes", root=np.eye(len(mass)), std=MASS_STD / max(len(mass), 1) ** 0.5)
    return ParameterBasis(
        names=tuple(f"mass at node {node}" for node in points),
        mass=moving * mass,
        damping=unchanged,
        stiffness=unchanged,
        logarithmic=np.zeros(len(mass), bool),
        terms=(term,) if len(mass) else (),
        at_nodes=dict(enumerate(points)),
        moving_kg=moving,
    )


def _part_basis(regions: tuple[Region, ...], *, stiffness: bool) -> ParameterBasis:
    matrices = np.array([region.stiffness if stiffness else region.mass for region in regions])
    unchanged = np.zeros_like(matrices)
    scale = 1.0 if stiffness else MASS_STD / GLOBAL_STD
    return ParameterBasis(
        names=tuple(f"{'stiffness' if stiffness else 'mass'} of {region.name}" for region in regions),
        mass=unchanged if stiffness else matrices,
        damping=unchanged,
        stiffness=matrices if stiffness else unchanged,
        logarithmic=np.ones(len(regions), bool),
        terms=_distance_terms(regions, scale, "stiffness" if stiffness else "mass"),
        regions=regions if stiffness else (),
    )


def _distance_terms(regions: tuple[Region, ...], scale: float, what: str) -> tuple[PriorTerm, ...]:
    """One factor for all, and fields whose correlation falls off as exp(-distance / length): they may jump."""
    positions = np.array([region.coordinates_m for region in regions])
    extent = max(float(np.ptp(positions, axis=0).max()), np.finfo(float).tiny)
    distance = np.sqrt(sum(np.subtract.outer(axis, axis) ** 2 for axis in positions.T)) / extent
    terms = [PriorTerm(name=f"a factor on the {what}", root=np.ones((len(regions), 1)), std=GLOBAL_STD * scale)]
    for length in SEGMENT_LENGTHS:
        correlation = np.exp(-distance / length) + SAME_POSITION * np.eye(len(regions))
        root = np.asarray(np.linalg.cholesky(correlation), np.float64)
        terms.append(PriorTerm(name=f"{what} along {length:.0%} of the structure", root=root, std=SEGMENT_STD * scale))
    return tuple(terms)
