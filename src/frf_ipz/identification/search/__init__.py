"""Which modes there are: found where the misfit has peaks, dropped where they are not significant."""
