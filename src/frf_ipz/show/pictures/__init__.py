"""What the page draws beyond the report: choices, shapes in motion, FRFs zoomed in."""
