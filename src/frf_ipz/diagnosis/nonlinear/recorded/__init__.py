"""What single recordings say: noise, and transforms of their stretches."""
