"""Force laws, one a module, found without a list."""
