"""After a first update, modes that were undecided or paired with another one find their own counterparts."""

from dataclasses import replace

import numpy as np
import pytest

from frf_ipz.pairing.pairs import Pairs, PairVerdict
from frf_ipz.updating import update as update_module
from frf_ipz.updating.options import UpdateOptions
from frf_ipz.updating.pairing_again import PairingAgain
from frf_ipz.updating.parameters import make_structural_basis
from frf_ipz.updating.update import update_model
from frf_testbench.updating.study import make_update_case


@pytest.fixture(scope="module")
def case():
    return make_update_case(7)


def update(case, pairs, **options):
    basis = make_structural_basis(case.structure.nominal_model, case.reduced_model)
    return update_model(case.fit, case.reduced_model, pairs=pairs, basis=basis, options=UpdateOptions(**options))


def without_last_pole(pairs):
    last = [row for row in pairs.targets if row.kind == "pole"][-1]
    rows = [replace(row, verdict=PairVerdict.AMBIGUOUS) if row is last else row for row in pairs.rows]
    return last, Pairs(rows=tuple(rows), labels=pairs.labels)


def test_a_pole_that_was_undecided_becomes_a_target_under_its_nominal_name(case):
    last, undecided = without_last_pole(case.pairs)
    updated = update(case, undecided)
    found = [row for row in updated.pairs.targets if row.kind == "pole" and row.measured == last.measured]
    assert [row.computed for row in found] == [last.computed]
    assert abs(found[0].computed_value - last.computed_value) < 1e-6 * abs(last.computed_value)
    assert len(updated.pairs.targets) == len(updated.before) == len(updated.after)
    own = [row.computed_value for row in updated.pairs.targets]
    assert np.max(np.abs(updated.before - own) / np.abs(own)) < 1e-6


def test_measured_shapes_are_expanded_with_the_pairs_that_were_found_again(case, monkeypatch):
    _, undecided = without_last_pole(case.pairs)
    handed = []

    def expand(updated, _fit, problem, **_options):
        handed.append((len(updated.pairs.targets), len(problem.values)))
        return updated

    monkeypatch.setattr(update_module, "with_expanded_shapes", expand)
    update(case, undecided)
    assert [count for count, _ in handed] == [count for _, count in handed] != []


def test_pairs_that_stand_are_left_alone(case):
    assert update(case, case.pairs).pairs is None


def test_pairs_are_kept_where_that_is_asked(case):
    _, undecided = without_last_pole(case.pairs)
    assert update(case, undecided, pair_again=False).pairs is None


def test_pairs_stand_where_others_bring_the_model_no_nearer_to_the_frfs(case, monkeypatch):
    _, undecided = without_last_pole(case.pairs)
    monkeypatch.setattr(PairingAgain, "deviation_db", lambda *_: 1.0)
    assert update(case, undecided).pairs is None
