"""Force laws, one a module, found by themselves."""
