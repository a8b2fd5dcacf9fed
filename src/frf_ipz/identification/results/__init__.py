"""What is reported: zeros, tables of modes and misfit, bands of confidence."""
