"""An independent simulator of vibration tests: it shares no code with frf_ipz, so that it can judge it."""
