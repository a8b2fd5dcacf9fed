"""Poles, residues and zeros of measured FRFs, with covariance."""
