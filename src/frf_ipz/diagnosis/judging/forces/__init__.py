"""Forces at one place that no effect of the catalogue describes; each kind a module, listed in `another_force`."""
