"""One module a kind of model; a module that is put here is found by itself."""
