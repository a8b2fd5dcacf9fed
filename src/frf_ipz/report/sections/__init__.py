"""Sections of the page, one module each: ``build(run)`` gives a section, or None where there is nothing to show."""
