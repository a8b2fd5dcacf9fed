"""Transfer functions in the right half of the s-plane from blows or from FRFs, and how well they are known."""
