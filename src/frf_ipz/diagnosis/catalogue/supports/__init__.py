"""Effects: held ends, springs to ground and between nodes, axial force."""
