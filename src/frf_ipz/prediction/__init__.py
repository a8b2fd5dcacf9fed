"""FRFs at points that were never measured, with honest bands."""
