"""What physics the model left out."""
