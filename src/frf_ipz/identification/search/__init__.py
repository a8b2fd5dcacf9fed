"""Which modes there are: added at peaks of the misfit, dropped where not significant, checked by halves."""
