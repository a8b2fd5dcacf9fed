"""From measured transfer functions to the components that explain them best, and how sure that is."""
