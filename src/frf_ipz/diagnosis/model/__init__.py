"""The nominal model in a few coordinates, what effects change in it, and its nuisance parameters."""
