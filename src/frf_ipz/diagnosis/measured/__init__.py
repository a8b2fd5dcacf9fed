"""Transfer functions in the right half of the s-plane, from records or FRFs, with the covariance of their errors."""
