"""Records without what is not the structure's response to the measured force."""
