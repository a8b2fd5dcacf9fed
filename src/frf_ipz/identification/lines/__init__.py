"""The measured lines as the fitter sees them: receptances, their noise, their weights."""
