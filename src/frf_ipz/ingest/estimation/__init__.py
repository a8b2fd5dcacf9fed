"""From recordings to FRFs, one kind of test a module: hammer, random, FRFs of others; and what they share."""
