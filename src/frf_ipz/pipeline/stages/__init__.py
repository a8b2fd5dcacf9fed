"""Each stage of the chain: what it computes, what its result depends on, which files it writes."""
