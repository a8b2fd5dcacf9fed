"""The blind proof of the diagnosis: cases are made, sealed, diagnosed, opened and scored."""
