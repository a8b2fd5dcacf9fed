"""The linear structure with a law: modal model, nuisance prior, and its response in time."""
