"""FE models: read, assembled, reduced; their modes and FRFs."""
