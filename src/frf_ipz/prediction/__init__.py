"""FRFs at points that were not measured, with their bands."""
