"""From fits to the verdict: data checks, goodness of fit, probabilities, findings, proof."""
