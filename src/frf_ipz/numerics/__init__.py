"""Arrays in, arrays out: knows no structure, no file, no options."""
