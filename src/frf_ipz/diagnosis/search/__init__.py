"""From measured transfer functions to the causes that explain them best, and how sure that is."""
