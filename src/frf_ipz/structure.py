"""Structural models: the full FE model, its parts, and its reduced form.

Data only. The stage `fe` builds and reduces them, `updating` changes the reduced form, `diagnosis` adds what was
missing to the full one.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import sparse

from frf_ipz.arguments import require_choice, take_array
from frf_ipz.arrays import BoolArray, FloatArray, IntArray, Matrix, require_finite, require_shape
from frf_ipz.display import Concise, Drawn
from frf_ipz.dofs import GENERALISED, GROUND, AnyDof, Dof, Port, PortDof, as_dofs, bind_port, parse_dof
from frf_ipz.errors import InputError, ShapeError
from frf_ipz.numerics.constraints import AdmissibleMotions
from frf_ipz.numerics.neighbours import lines_between_neighbours
from frf_ipz.numerics.structural_matrices import MatrixOptions, ModelMatrices
from frf_ipz.unit_systems import SI, UnitSystem
from frf_ipz.visible_text import counted

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike

EPS = float(np.finfo(float).eps)
SPACING_M = 1.0  # between nodes in a row, where nobody knows their positions

DOFS_SHOWN = 6
MOST_PLACES = 8  # models whose DOFs are found by name at once
HELD = ("auto", "keep")
GENERALISED_LABEL = re.compile(r"\s*([0-9]{1,18})\s*:\s*[q0]\s*")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Part(Concise):
    """An additive part of a model with a name: an element, a spring, a group, a point mass.

    Parameters
    ----------
    kind : str
        ``element``, ``spring``, ``group`` or ``point``.
    name : str
        Element number, spring id or group name.
    nodes : tuple of int
        The nodes it joins.
    indices : (k,) int array
        Its rows among `StructuralModel.all_dofs`.
    stiffness, mass : (k, k) array
        Its share of the matrices, N/m and kg (and their rotational counterparts); sparse for groups, which can be
        large.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> part = beam.parts[0]
    >>> part.kind, part.name, part.nodes
    ('element', '1', (1, 2))
    """

    kind: str
    name: str
    nodes: tuple[int, ...]
    indices: IntArray
    stiffness: FloatArray | Matrix
    mass: FloatArray | Matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Mesh(Concise):
    """What is drawn of a structure: the surface of its elements, or lines between measured points.

    Parameters
    ----------
    nodes : (n_nodes,) int array
        Node numbers; those without a DOF, such as held ones, are among them.
    coordinates_m : (n_nodes, 3) array
        Their positions.
    lines : (n_lines, 2) int array
        Pairs of node numbers.
    faces : (n_faces, 4) int array
        Node numbers around; the last one of a triangle twice.

    Examples
    --------
    >>> import numpy as np, frf_ipz
    >>> frf_ipz.Mesh(
    ...     nodes=np.array([1, 2, 3]), coordinates_m=np.eye(3), lines=np.array([[1, 2], [2, 3]]),
    ...     faces=np.array([[1, 2, 3, 3]]),
    ... ).faces.shape
    (1, 4)
    """

    nodes: IntArray
    coordinates_m: FloatArray
    lines: IntArray
    faces: IntArray

    def __post_init__(self) -> None:
        require_shape("coordinates_m", self.coordinates_m, (len(self.nodes), 3))
        require_shape("lines", self.lines, (len(self.lines), 2))
        require_shape("faces", self.faces, (len(self.faces), 4))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Geometry(Concise):
    """Where the nodes are, for drawing and for positions along the structure.

    Parameters
    ----------
    nodes : (n_nodes,) int array
        Node numbers.
    coordinates_m : (n_nodes, 3) array
        Positions; for a lumped model the masses in a row.
    lines : (n_lines, 2) int array
        Pairs of node numbers that are drawn as lines.
    supports : mapping of int to str
        How a node is supported: ``clamped``, ``pinned``, ``sliding`` or ``ground``.
    is_schematic : bool
        Coordinates are no positions: the masses of a lumped model drawn in a row.
    ports : mapping of str to tuple of int
        The nodes that each port joins.
    mesh : Mesh, optional
        What is drawn, where a file says what lies between nodes.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> beam.geometry.coordinates_m[-1].round(6).tolist(), beam.geometry.supports
    ([0.5, 0.0, 0.0], {1: 'clamped'})
    """

    nodes: IntArray
    coordinates_m: FloatArray
    lines: IntArray
    supports: Mapping[int, str] = field(default_factory=dict)
    is_schematic: bool = False
    ports: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    mesh: Mesh | None = None

    def outline(self, nodes: Iterable[int] = ()) -> Mesh:
        """Give what is drawn.

        Parameters
        ----------
        nodes : iterable of int
            Nodes that are drawn in any case, as far as they are known.

        Returns
        -------
        Mesh
            With its faces where a file says what lies between nodes; else all nodes and lines.
        """
        if self.mesh is None:
            none = np.zeros((0, 4), np.int64)
            return Mesh(nodes=self.nodes, coordinates_m=self.coordinates_m, lines=self.lines, faces=none)
        beside = np.isin(self.nodes, list(set(nodes) - set(self.mesh.nodes.tolist())))
        return replace(
            self.mesh,
            nodes=np.concatenate([self.mesh.nodes, self.nodes[beside]]),
            coordinates_m=np.vstack([self.mesh.coordinates_m, self.coordinates_m[beside]]),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StructuralModel(Drawn):
    """A linear FE model ``M x'' + B x' + K x = f`` with modal damping besides B.

    The matrices are those of all DOFs, the held ones (`fixed`) included, so that a support can be released.

    Parameters
    ----------
    name : str
        As the user calls it.
    kind : str
        ``beam``, ``lumped`` or ``matrices``.
    all_dofs : tuple of Dof
        Rows of the matrices.
    fixed : (n_all,) bool array
        True for DOFs that are held.
    mass_all, stiffness_all : (n_all, n_all) sparse array
        kg and N/m (and their rotational counterparts), symmetric.
    damping_all : (n_all, n_all) sparse array
        Viscous damping that the model states as a matrix, N s/m; empty where it states none.
    modal_damping : (n,) array
        Damping ratios of the modes; the last one holds for all further modes. Empty where the model states none.
    geometry : Geometry
        Where the nodes are.
    parts : tuple of Part
        Its elements, springs, groups and point masses.
    held_dofs : tuple of Dof
        DOFs that have no row, because what made the matrices holds them.
    structural_damping_all : (n_all, n_all) sparse array, optional
        Imaginary part of a complex stiffness, N/m. A mode takes from it the damping ratio ``phi^T K'' phi / (2
        omega^2)``, which is right at its resonance; it couples no modes.
    motions : AdmissibleMotions, optional
        Where constraint equations join DOFs: the motions that satisfy them.
    n_massless : int
        Independent motions without mass, which follow the others statically.
    allows_negative_stiffness : bool
        Negative eigenvalues of the stiffness are meant: magnets, buckling. The poles of such a mode are real.
    notes : tuple of str
        What was recognised in the matrices, and how they were taken.
    rounding : float
        Relative rounding of the entries of the stiffness matrix: that of double precision, or of printed digits.
    ports : tuple of Port
        Inputs and outputs that are no single DOFs.
    source : object
        The options it was built from (`fe.model_file`), for effects that build it anew; None for a model without.
    full_indices : mapping of Dof to int
        Row of each DOF in the matrices of all DOFs; made here.

    Raises
    ------
    InputError
        If sizes disagree or a DOF is named twice.

    Examples
    --------
    >>> import frf_ipz
    >>> beam = frf_ipz.make_beam(
    ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700, elements=10,
    ...     left="clamped", modal_ratio=0.01,
    ... )
    >>> beam
    StructuralModel: beam (beam), 20 free DOFs, 11 nodes
    >>> beam.index(frf_ipz.Dof(2, "z")), beam.stiffness.shape
    (0, (20, 20))
    """

    name: str
    kind: str
    all_dofs: tuple[Dof, ...]
    fixed: BoolArray
    mass_all: Matrix
    stiffness_all: Matrix
    damping_all: Matrix
    modal_damping: FloatArray
    geometry: Geometry
    parts: tuple[Part, ...] = ()
    structural_damping_all: Matrix | None = None
    motions: AdmissibleMotions | None = None
    n_massless: int = 0
    allows_negative_stiffness: bool = False
    held_dofs: tuple[Dof, ...] = ()
    notes: tuple[str, ...] = ()
    rounding: float = EPS
    ports: tuple[Port, ...] = ()
    source: object = None
    full_indices: Mapping[Dof, int] = field(init=False, repr=False)

    def __repr__(self) -> str:
        return (
            f"StructuralModel: {self.name} ({self.kind}), {len(self.dofs)} free DOFs, {len(self.geometry.nodes)} nodes"
        )

    def __post_init__(self) -> None:
        n_all = len(self.all_dofs)
        object.__setattr__(self, "full_indices", {dof: index for index, dof in enumerate(self.all_dofs)})
        if len(self.full_indices) < n_all:
            raise InputError(f"the model '{self.name}' names a DOF twice")
        for name in ("mass_all", "stiffness_all", "damping_all"):
            if getattr(self, name).shape != (n_all, n_all):
                raise InputError(f"{name} is {getattr(self, name).shape}, but the model has {counted(n_all, 'DOF')}")
        require_shape("the marks of held DOFs", self.fixed, (n_all,))
        self._check_ports()

    @classmethod
    def from_matrices(
        cls,
        mass: ArrayLike | Matrix,
        stiffness: ArrayLike | Matrix,
        damping: ArrayLike | Matrix | None = None,
        *,
        dofs: Sequence[Dof | str],
        coordinates: Mapping[int, Sequence[float]] | ArrayLike | None = None,
        modal_damping: float | Sequence[float] = (),
        name: str = "model",
        held: str = "auto",
        units: str | Mapping[str, str] = SI,
        allow_negative_stiffness: bool = False,
    ) -> StructuralModel:
        """Make a model from matrices, and check it.

        Parameters
        ----------
        mass, stiffness : (n, n) array, dense or sparse
            kg and N/m (and their rotational counterparts), symmetric. A complex stiffness is one with structural
            damping. DOFs may lack mass, and rows may be those of Lagrange multipliers.
        damping : (n, n) array, dense or sparse, optional
            Viscous damping, N s/m.
        dofs : sequence of Dof or str
            One a row, such as ``"1:x"``; ``"9:q"`` for the amplitude of a mode or of a super-element's motion.
        coordinates : mapping of int to (3,) sequence, or (n_nodes, 3) array, optional
            Positions of the nodes, m: by node number, or in the order in which `dofs` names the nodes first. Without
            them the nodes are drawn in a row.
        modal_damping : float or sequence of float
            Damping ratios of the elastic modes besides `damping`; the last one holds for all further modes.
        name : str
            What it is called.
        held : str
            ``auto``: rows that are zero, rows of the identity, and rows with a penalty such as 1e36 on the diagonal are
            held DOFs, which are left out; ``keep``: all rows are taken as they are.
        units : str or mapping of str to str
            What matrices and coordinates are in: ``SI``, ``mm-t-s``, ``mm-kg-ms``, ``cm-g-s``, ``in-lbf-s``, or the
            units of ``length``, ``mass`` and ``time``.
        allow_negative_stiffness : bool
            Whether the stiffness may have negative eigenvalues.

        Returns
        -------
        StructuralModel
            The model, in SI; its `notes` say what was left out.

        Raises
        ------
        ShapeError
            If shapes disagree.
        InputError
            If a matrix is not symmetric, the mass is not positive definite, stiffness or damping is indefinite, a DOF
            is named twice, or a node has no position.

        Examples
        --------
        >>> stiffness = [[30.0, -10.0], [-10.0, 10.0]]
        >>> model = StructuralModel.from_matrices(np.diag([2.0, 1.0]), stiffness, dofs=["1:x", "2:x"])
        >>> [dof.name for dof in model.dofs]
        ['1:x', '2:x']
        """
        require_choice("held", held, HELD)
        rows = _rows(dofs)
        whole = {"mass": _square_matrix("mass", mass, len(rows))}
        whole["stiffness"] = _square_matrix("stiffness", stiffness, len(rows))
        if damping is not None:
            whole["damping"] = _square_matrix("damping", damping, len(rows))
        system = UnitSystem.of(units)
        options = MatrixOptions(held=held, units=system, allow_negative_stiffness=allow_negative_stiffness)
        matrices = ModelMatrices.of(whole, rows, options, errors=_errors_of_matrix)
        nodes, positions = _positions(rows, coordinates)
        return cls.from_model_matrices(
            matrices,
            name=name,
            geometry=drawn_geometry(matrices, nodes, system.length_m * positions, is_schematic=coordinates is None),
            modal_damping=_damping_ratios(modal_damping),
            allow_negative_stiffness=allow_negative_stiffness,
        )

    @classmethod
    def from_model_matrices(
        cls,
        matrices: ModelMatrices,
        *,
        name: str,
        geometry: Geometry,
        modal_damping: FloatArray,
        allow_negative_stiffness: bool,
    ) -> StructuralModel:
        """Make a model from matrices that have been checked.

        Parameters
        ----------
        matrices : ModelMatrices
            In SI.
        name : str
            What it is called.
        geometry : Geometry
            Where the nodes are.
        modal_damping : (n,) array
            Damping ratios of the elastic modes.
        allow_negative_stiffness : bool
            Whether the stiffness may have negative eigenvalues.

        Returns
        -------
        StructuralModel
            The model, without parts.
        """
        return cls(
            name=name,
            kind="matrices",
            all_dofs=matrices.dofs,
            fixed=np.zeros(len(matrices.dofs), bool),
            mass_all=matrices.mass,
            stiffness_all=matrices.stiffness,
            damping_all=matrices.damping,
            structural_damping_all=matrices.structural_damping if matrices.structural_damping.nnz else None,
            motions=matrices.motions,
            n_massless=matrices.n_massless,
            allows_negative_stiffness=allow_negative_stiffness,
            modal_damping=modal_damping,
            geometry=geometry,
            held_dofs=matrices.held_dofs,
            notes=matrices.notes,
            rounding=matrices.rounding,
        )

    def with_ports(self, ports: Sequence[Port]) -> StructuralModel:
        """Add inputs and outputs that are no single DOFs.

        Parameters
        ----------
        ports : sequence of Port
            Beside those that the model has.

        Returns
        -------
        StructuralModel
            The same model, which knows these names.

        Raises
        ------
        InputError
            If two ports have one name, a DOF is none of the model, or all of a port's DOFs are held.

        Examples
        --------
        >>> import frf_ipz
        >>> beam = frf_ipz.make_beam(
        ...     length_m=0.5, width_m=0.02, thickness_m=0.005, youngs_modulus_Pa=70e9, density_kg_m3=2700,
        ...     elements=10, left="clamped",
        ... ).with_ports([frf_ipz.Port("tip tilt", {"11:z": 20.0, "10:z": -20.0}, "rad")])
        >>> beam.rows(["-tip tilt"]).toarray()[0, -4:].tolist()
        [20.0, 0.0, -20.0, 0.0]
        """
        return replace(self, ports=(*self.ports, *ports))

    @property
    def port_dofs(self) -> dict[PortDof, PortDof]:
        """Labels of the ports, each by itself: what is looked up has the unit of its port."""
        return {port.dof: port.dof for port in self.ports}

    @property
    def dofs(self) -> tuple[Dof, ...]:
        """The DOFs that are free, in the order of `mass` and `stiffness`."""
        return tuple(dof for dof, fixed in zip(self.all_dofs, self.fixed, strict=True) if not fixed)

    @property
    def mass(self) -> Matrix:
        """(n, n) mass matrix of the free DOFs."""
        return self._free_block(self.mass_all)

    @property
    def stiffness(self) -> Matrix:
        """(n, n) stiffness matrix of the free DOFs."""
        return self._free_block(self.stiffness_all)

    @property
    def damping(self) -> Matrix:
        """(n, n) viscous damping matrix of the free DOFs, without the modal damping."""
        return self._free_block(self.damping_all)

    @property
    def structural_damping(self) -> Matrix | None:
        """(n, n) imaginary part of the stiffness of the free DOFs; None where it is real."""
        return None if self.structural_damping_all is None else self._free_block(self.structural_damping_all)

    @property
    def free_motions(self) -> AdmissibleMotions | None:
        """Motions of the free DOFs that satisfy the constraint equations; None where there is no equation."""
        if self.motions is None or not self.fixed.any():
            return self.motions
        return self.motions.rows(np.flatnonzero(~self.fixed))

    @property
    def n_modes(self) -> int:
        """Number of modes: that of the free DOFs that follow from no others, less the motions without mass."""
        motions = self.free_motions
        n_independent = np.count_nonzero(~self.fixed) if motions is None else len(motions.independent)
        return int(n_independent) - self.n_massless

    def full_index(self, dof: Dof) -> int:
        """Row of a DOF among all, the held ones included.

        Parameters
        ----------
        dof : Dof
            The sign is ignored.

        Returns
        -------
        int
            Row of `mass_all` and `stiffness_all`.

        Raises
        ------
        InputError
            If the model has no such DOF.
        """
        try:
            return self.full_indices[dof.unsigned]
        except KeyError:
            raise InputError(self._missing_dof_message(dof)) from None

    def index(self, dof: Dof) -> int:
        """Row of a DOF among the free ones.

        Parameters
        ----------
        dof : Dof
            The sign is ignored.

        Returns
        -------
        int
            Row of `mass` and `stiffness`.

        Raises
        ------
        InputError
            If the model has no such DOF, or holds it.
        """
        index = self.full_index(dof)
        if self.fixed[index]:
            raise InputError(
                f"the DOF {dof.name} is held in the model '{self.name}', so nothing moves there: "
                "use another DOF, or free that support in the model"
            )
        return int(np.count_nonzero(~self.fixed[:index]))

    def full_rows(self, dofs: Sequence[AnyDof | Port | str]) -> Matrix:
        """Motions that sensors measure, or how forces act, in all DOFs.

        Parameters
        ----------
        dofs : sequence of Dof, PortDof, Port or str
            DOFs, ports, or their labels; their signs count.

        Returns
        -------
        (n_dofs, n_all) sparse array
            Weights of all DOFs, held ones included.

        Raises
        ------
        InputError
            If the model has no such DOF or port.
        """
        entries = [
            (row, self.full_index(dof), weight)
            for row, label in enumerate(as_dofs(dofs))
            for dof, weight in self._weights(label).items()
            if dof.node != GROUND and dof not in self.held_dofs
        ]
        rows, columns, weights = zip(*entries, strict=True) if entries else ((), (), ())
        shape = (len(dofs), len(self.all_dofs))
        return sparse.csr_array((np.array(weights, float), (rows, columns)), shape=shape)

    def rows(self, dofs: Sequence[AnyDof | Port | str]) -> Matrix:
        """Motions that sensors measure, or how forces act, in the free DOFs.

        Parameters
        ----------
        dofs : sequence of Dof, PortDof, Port or str
            DOFs, ports, or their labels; their signs count.

        Returns
        -------
        (n_dofs, n) sparse array
            Weights of the rows of `mass` and `stiffness`.

        Raises
        ------
        InputError
            If the model has no such DOF or port, or holds it.
        """
        for label in as_dofs(dofs):
            if isinstance(label, Dof):
                self.index(label)
        return self.full_rows(dofs)[:, np.flatnonzero(~self.fixed)]

    def dofs_in(self, dofs: Sequence[AnyDof | Port | str]) -> tuple[Dof, ...]:
        """DOFs that take part in some motions: those themselves, and those with a weight in a port.

        Parameters
        ----------
        dofs : sequence of Dof, PortDof, Port or str
            DOFs, ports, or their labels.

        Returns
        -------
        tuple of Dof
            Unsigned, each once; those of the ground and of held DOFs without a row are left out.

        Raises
        ------
        InputError
            If the model has no such DOF or port.
        """
        taking_part = (dof for label in as_dofs(dofs) for dof, weight in self._weights(label).items() if weight)
        return tuple(dict.fromkeys(dof for dof in taking_part if dof in self.full_indices))

    def _weights(self, label: AnyDof) -> dict[Dof, float]:
        if isinstance(label, Dof):
            self.full_index(label)
            return {label.unsigned: float(label.sign)}
        bound = bind_port(label, self.port_dofs)
        port = next(port for port in self.ports if port.dof == bound.unsigned)
        return {dof: label.sign * weight for dof, weight in port.weights.items()}

    @property
    def drawn_geometry(self) -> Geometry:
        """Where nodes are and what joins them, with the nodes of the ports."""
        ports = {port.name: tuple(sorted({dof.node for dof in port.weights} - {GROUND})) for port in self.ports}
        return replace(self.geometry, ports=ports)

    def _check_ports(self) -> None:
        for number, port in enumerate(self.ports):
            if port.name in [known.name for known in self.ports[:number]]:
                raise InputError(f"two ports are called '{port.name}'; rename one")
            moving = []
            for dof, weight in port.weights.items():
                if dof.node == GROUND or dof in self.held_dofs:
                    continue
                if dof not in self.full_indices:
                    raise InputError(f"the port '{port.name}': {self._missing_dof_message(dof)}")
                moving.append(weight != 0 and not self.fixed[self.full_indices[dof]])
            if not any(moving):
                raise InputError(
                    f"the port '{port.name}' does not move: its DOFs are held in the model '{self.name}'; use others"
                )

    def _free_block(self, matrix: Matrix) -> Matrix:
        if not self.fixed.any():
            return matrix
        free = np.flatnonzero(~self.fixed)
        return matrix[free][:, free]

    def _missing_dof_message(self, dof: Dof) -> str:
        if dof.unsigned in self.held_dofs:
            return (
                f"the DOF {dof.name} is held in the model '{self.name}': its row of the matrices is that of a support "
                "or of a mass that couples to nothing, so nothing moves there with the structure; use another DOF, or "
                "take the row as it is by [matrices] held = 'keep'"
            )
        directions = [known.direction for known in self.all_dofs if known.node == dof.node]
        if directions:
            return (
                f"node {dof.node} of the model '{self.name}' has no DOF '{dof.direction}'; "
                f"it has {', '.join(directions)}: correct the test or the pipeline"
            )
        nodes = self.geometry.nodes
        return (
            f"the model '{self.name}' has no node {dof.node}; its nodes go from {nodes.min()} to {nodes.max()}: "
            "correct the test or the pipeline"
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReducedModel:
    """A reduced model in physical DOFs, eq. (2) of [Dorosti2018] (doi:10.1016/j.conengprac.2017.11.002).

    Parameters
    ----------
    mass, damping, stiffness : (r, r) array
        M_r, B_r and K_r. Symmetric when they leave the reduction; `ipz` may leave K_r and B_r slightly unsymmetric.
    dofs : tuple of Dof or PortDof
        The retained DOFs and ports, unsigned, one a row.
    expansion : (n_expanded, r) array
        Motion of other DOFs of the full model for unit motions of the retained ones.
    expanded_dofs : tuple of Dof or PortDof
        Rows of `expansion`, unsigned; they contain the retained ones, and all ports of the full model.
    n_modes : int
        Eigenmodes in the reduction basis, rigid-body modes included.
    residual_dofs : tuple of Dof
        DOFs whose residual flexibility is in the basis.
    choices : tuple of str
        What the program chose by itself, as sentences.
    dashpots : (r, r) array
        The part of `damping` that the full model states as a matrix beside damping ratios of its modes; (0, 0) where it
        does not state both.
    rigid : (r, n_rigid) array
        Mass-normalised rigid-body modes, which strain nothing; (0, 0) where there is none.

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
    >>> reduced_model
    ReducedModel: 6 DOFs (11:+z, 6:+z, 9:+z, 10:+z, 3:+z, 5:+z), 5 modes in its basis
    >>> float(reduced_model.row(frf_ipz.Dof(9, "z", -1)).round(6).min())
    -1.0
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    dofs: tuple[AnyDof, ...]
    expansion: FloatArray
    expanded_dofs: tuple[AnyDof, ...]
    n_modes: int
    residual_dofs: tuple[AnyDof, ...] = ()
    choices: tuple[str, ...] = ()
    dashpots: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    rigid: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    def __repr__(self) -> str:
        dofs = ", ".join(map(str, self.dofs[:DOFS_SHOWN])) + (", ..." if len(self.dofs) > DOFS_SHOWN else "")
        return f"ReducedModel: {counted(len(self.dofs), 'DOF')} ({dofs}), {counted(self.n_modes, 'mode')} in its basis"

    def __post_init__(self) -> None:
        order = len(self.dofs)
        if self.dashpots.size:
            require_shape("the reduced matrix of dashpots", self.dashpots, (order, order))
        if self.rigid.size:
            require_shape("the rigid-body modes", self.rigid, (order, self.rigid.shape[1]))
        for name in ("mass", "damping", "stiffness"):
            require_shape(f"the reduced {name} matrix", getattr(self, name), (order, order))
        require_shape("the expansion", self.expansion, (len(self.expanded_dofs), order))

    def row(self, dof: AnyDof) -> FloatArray:
        """Motion of a DOF or a port for unit motions of the retained ones.

        Parameters
        ----------
        dof : Dof or PortDof
            Its sign counts.

        Returns
        -------
        (r,) array
            A row of the output or input matrix.

        Raises
        ------
        InputError
            If the DOF is not among the expanded ones.
        """
        row = _places_of(self.expanded_dofs).get(dof.unsigned)
        if row is None:
            raise InputError(
                f"the reduced model does not know the {'DOF' if isinstance(dof, Dof) else 'port'} {dof.name}; add it "
                "to [predict] points"
            )
        return np.asarray(dof.sign * self.expansion[row])


_places: dict[int, tuple[tuple[AnyDof, ...], dict[AnyDof, int]]] = {}  # by identity: hashing thousands takes as long


def _places_of(dofs: tuple[AnyDof, ...]) -> dict[AnyDof, int]:
    """Where each DOF stands; known of the last few tuples, which are held so that no other takes their identity."""
    known = _places.get(id(dofs))
    if known is None:
        if len(_places) >= MOST_PLACES:
            _places.clear()
        known = dofs, {dof: place for place, dof in reversed(tuple(enumerate(dofs)))}
        _places[id(dofs)] = known
    return known[1]


def drawn_geometry(
    matrices: ModelMatrices,
    nodes: IntArray,
    positions_m: FloatArray,
    *,
    is_schematic: bool = False,
    mesh: Mesh | None = None,
) -> Geometry:
    """Find how to draw a model of which only matrices are known.

    Parameters
    ----------
    matrices : ModelMatrices
        Its matrices.
    nodes : (n_nodes,) int array
        Node numbers, ascending.
    positions_m : (n_nodes, 3) array
        Their positions.
    is_schematic : bool
        Positions are those of nodes in a row.
    mesh : Mesh, optional
        What lies between nodes, where a file says it.

    Returns
    -------
    Geometry
        Nodes that only multipliers have are left out, and those of generalised DOFs stand in the middle.
    """
    structural = {dof.node for dof in (*matrices.dofs, *matrices.held_dofs) if dof.direction != GENERALISED}
    generalised = {dof.node for dof in matrices.dofs if dof.direction == GENERALISED} - structural
    is_structural = np.isin(nodes, list(structural))
    kept = is_structural | np.isin(nodes, list(generalised))
    if generalised and is_structural.any():
        positions_m = np.where(is_structural[:, None], positions_m, positions_m[is_structural].mean(axis=0))
    drawn = np.array([row for row, dof in enumerate(matrices.dofs) if dof.direction != GENERALISED], np.int64)
    return Geometry(
        nodes=nodes[kept],
        coordinates_m=positions_m[kept],
        lines=lines_between_neighbours(
            matrices.stiffness[drawn][:, drawn],
            [matrices.dofs[row] for row in drawn.tolist()],
            nodes[kept],
            positions_m[kept],
        ),
        supports=matrices.supports,
        is_schematic=is_schematic,
        mesh=mesh,
    )


def _rows(dofs: Sequence[Dof | str]) -> tuple[Dof, ...]:
    """Take the DOFs of rows; a generalised one is no DOF that a label names."""
    if isinstance(dofs, str | Dof) or not isinstance(dofs, Iterable):
        as_dofs(dofs, name="dofs")  # raises
    matches = [GENERALISED_LABEL.fullmatch(dof) if isinstance(dof, str) else None for dof in dofs]
    return tuple(
        Dof(int(match[1]), GENERALISED) if match else (dof if isinstance(dof, Dof) else parse_dof(dof)).unsigned
        for dof, match in zip(dofs, matches, strict=True)
    )


@contextmanager
def _errors_of_matrix(what: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        is_predicate = str(error).startswith(("is ", "holds "))  # which a file's name would precede
        raise InputError(f"the {what} matrix {error}" if is_predicate else str(error)) from None


def _square_matrix(what: str, matrix: ArrayLike | Matrix, order: int) -> Matrix:
    """Take a matrix, dense or sparse, as a sparse one."""
    given: Any = matrix if sparse.issparse(matrix) else np.atleast_2d(np.asarray(matrix))
    if given.shape != (order, order):
        raise ShapeError(f"the {what} matrix is {given.shape}, but {order} DOFs are named; one row a DOF is needed")
    if given.dtype.kind not in ("iufc" if what == "stiffness" else "iuf"):
        raise InputError(f"the {what} matrix holds {given.dtype} values; real ones are needed")
    return sparse.csr_array(given, dtype=np.complex128 if given.dtype.kind == "c" else np.float64)


def _positions(
    dofs: Sequence[Dof], coordinates: Mapping[int, Sequence[float]] | ArrayLike | None
) -> tuple[IntArray, FloatArray]:
    """Give the nodes, ascending, and the position of each."""
    named = list(dict.fromkeys(dof.node for dof in dofs))
    if coordinates is None:
        position_of = {node: (SPACING_M * place, 0.0, 0.0) for place, node in enumerate(sorted(named))}
    elif isinstance(coordinates, Mapping):
        position_of = {
            int(node): tuple(take_array(f"the position of node {node}", position, np.float64, (3,)).tolist())
            for node, position in coordinates.items()
        }
    else:
        table = take_array("the coordinates", coordinates, np.float64, (len(named), 3))
        position_of = dict(zip(named, map(tuple, table.tolist()), strict=True))
    missing = [node for node in named if len(position_of.get(node, ())) != 3]
    if missing:
        raise InputError(f"node {missing[0]} has no position; coordinates need x, y and z of every node, in m")
    nodes = np.array(sorted(named), np.int64)
    positions = np.array([position_of[node] for node in nodes.tolist()], float)
    require_finite("the coordinates", positions)
    return nodes, positions


def _damping_ratios(ratios: float | Sequence[float]) -> FloatArray:
    given = take_array("the damping ratios", np.atleast_1d(ratios), np.float64, is_finite=False)
    if not ((given >= 0) & (given < 1)).all():
        raise InputError(f"modal_damping is {ratios}; damping ratios lie from 0 to below 1")
    return given
