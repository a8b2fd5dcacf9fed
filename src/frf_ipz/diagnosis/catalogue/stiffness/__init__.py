"""Effects: elastic parts that are softer or stiffer, or relax."""
