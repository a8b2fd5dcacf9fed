"""The smallest change: phases, their one iteration, prior scales, and draws of what remains open."""
