"""Parts of the method ``minimal-change``: its phases, their one iteration, outliers, and draws of what remains open."""
