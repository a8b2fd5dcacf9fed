"""Starting files for a folder: what can be seen is filled in, what cannot is marked for the user."""
