"""Fits of the sums of simple forces at a place, as a search finds them."""

from frf_ipz.diagnosis.nonlinear.fitting.simple_laws import SimpleLawsFit


def simple_laws_at(location, cost, *, n_rows=100, linear_mean_misfit=50.0):
    return SimpleLawsFit(
        location=location,
        cost=cost,
        mean_misfit=cost / n_rows,
        linear_mean_misfit=linear_mean_misfit,
        nuisance_chi2=1.0,
    )
