"""Stages in a session that knows nothing of threads of linear algebra."""

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import frf_ipz
from frf_ipz.assessment.assess import assess
from frf_ipz.numerics.one_thread import on_one_thread
from frf_ipz.pipeline.run import run_chain


def threads():
    return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}


def test_a_stage_uses_one_thread_and_gives_the_others_back():
    @on_one_thread
    def look(place, *, then):
        return place, then, threads()

    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        assert look(1, then=2) == (1, 2, {1})
        assert threads() == before


@pytest.mark.parametrize(
    "stage",
    [
        *("fit_modes", "fit_residues", "reduce_model", "make_structural_basis", "pair_roots", "update_model"),
        *("predict_frfs", "band_of_magnitudes", "compare_states", "estimate_uncertainty_weights"),
        *("to_state_space_ensemble", "decouple_rigid_body"),
    ],
)
def test_stages_of_small_matrices_are_held(stage):
    assert on_one_thread(len).__code__ is getattr(frf_ipz, stage).__code__


def test_what_runs_between_the_stages_of_a_chain_is_held_too():
    assert on_one_thread(len).__code__ is run_chain.__code__ is assess.__code__
