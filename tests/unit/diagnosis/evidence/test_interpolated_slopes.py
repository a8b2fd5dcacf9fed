"""Derivatives from a few points of the contour are those at all points."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from diagnosed import BAND_HZ, beam, measured, observed
from frf_ipz.diagnosis.catalogue.effects.attached_resonator import AttachedResonator
from frf_ipz.diagnosis.evidence.hypothesis import Component
from frf_ipz.diagnosis.evidence.inference_problem import pose_problem
from frf_ipz.diagnosis.evidence.interpolated_slopes import (
    InterpolatedSlopes,
    WhitenedSlopes,
    differentiate_by_nuisance,
    interpolate_slopes,
)
from frf_ipz.diagnosis.location import Location
from frf_ipz.diagnosis.measured.data_split import split_data
from frf_ipz.diagnosis.model.response import nuisance_jacobian
from frf_ipz.diagnosis.options import DiagnoseOptions

ACCURATE = 1e-6  # of the size of two derivatives: a fit's own derivatives by differences are not exact to more


@pytest.fixture(scope="module")
def nominal(tmp_path_factory):
    return beam(tmp_path_factory.mktemp("beam"))


def respond(problem, components):
    """Respond with errors within all tolerances, so that no derivative vanishes."""
    hypothesis = problem.make_hypothesis(components)
    values = np.array([parameter.typical for parameter in hypothesis.parameters])
    nuisance = 0.5 * np.random.default_rng(1).standard_normal(problem.nuisance_prior.size)
    return hypothesis.respond(values, nuisance, problem.data.measured.s)


@pytest.mark.parametrize("gains", ["none", "common", "per_channel"])
@pytest.mark.parametrize("is_attached", [False, True])
def test_they_are_those_at_all_points(nominal, gains, is_attached):
    problem = pose_problem(
        nominal, split_data(observed(measured(nominal))), BAND_HZ, DiagnoseOptions(), {}, free_gains=gains
    )
    resonator = Component(effect=AttachedResonator(), location=Location.at_node(6, "z"), n_locations=1)
    response = respond(problem, (resonator,) if is_attached else ())
    layout, prior, data = problem.context.layout, problem.nuisance_prior, problem.data
    exact = WhitenedSlopes(data.slopes(response, nuisance_jacobian(response, prior, layout)))
    slopes = interpolate_slopes(data, response, prior, layout)
    n_directions = slopes.directions.shape[2]
    assert n_directions < len(response.s) / 2
    sizes = np.sqrt(np.diag(exact.products())) + 1  # beside the prior, whose curvature is 1
    scale = np.outer(sizes, sizes)
    assert_allclose(slopes.products() / scale, exact.products() / scale, rtol=0, atol=ACCURATE)
    misfit = data.misfit(response)[:, None]
    scale = sizes[:, None] * np.linalg.norm(misfit)
    assert_allclose(slopes.products_with(misfit) / scale, exact.products_with(misfit) / scale, rtol=0, atol=ACCURATE)


def test_few_points_are_used_where_there_are_many_derivatives(nominal):
    problem = pose_problem(nominal, split_data(observed(measured(nominal))), BAND_HZ, DiagnoseOptions(), {})
    response, layout = respond(problem, ()), problem.context.layout
    slopes = differentiate_by_nuisance(problem.data, response, problem.nuisance_prior, layout)
    many = problem.nuisance_prior.size > 100
    assert isinstance(slopes, InterpolatedSlopes if many else WhitenedSlopes)
