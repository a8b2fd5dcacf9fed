"""From recordings to FRFs, one kind of test a module."""
