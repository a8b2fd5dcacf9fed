"""What frf_ipz does on measurements by others, whose recordings are not part of the repository."""
