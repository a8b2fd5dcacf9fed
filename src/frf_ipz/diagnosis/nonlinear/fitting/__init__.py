"""From all laws at all locations to the best fit: score test, alternating fit, output-error fit."""
