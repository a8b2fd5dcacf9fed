"""From all laws at all places to the one that fits best: screening, refinement, simulation."""
