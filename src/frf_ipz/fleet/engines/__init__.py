"""Where the machines of a fleet are computed: each engine is one module, and gives the same records."""
