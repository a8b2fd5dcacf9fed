"""From fits to what is said: gates, figures, verdict, probabilities, ambiguities."""
