"""The chain: recordings, FRFs, fitted model, pairs, updated model, prediction, export, report."""
