"""What frf_ipz is judged by: an independent simulator, the blind proof of the diagnosis, the study of updating."""
