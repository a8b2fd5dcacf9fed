"""Which measured pole and zero is which of the model."""
