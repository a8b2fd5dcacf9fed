"""From the FE model to the reduced one: what is asked for, which DOFs are retained, and the reduced matrices."""
