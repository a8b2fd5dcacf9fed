"""The maximum-likelihood fit: compressed data, refined poles, structured residues, covariance."""
