"""Effects: masses and resonators, shear and rotary inertia."""
