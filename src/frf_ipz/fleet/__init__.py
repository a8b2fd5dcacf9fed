"""Many machines of one kind: run one by one with one FE model, then looked at together."""
