"""What single signals tell: pulses, clipping, decay, noise; arrays in, numbers out."""
