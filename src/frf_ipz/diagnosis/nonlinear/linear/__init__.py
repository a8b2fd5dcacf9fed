"""The linear structure that a law sits on, and what it may deviate by from its model."""
