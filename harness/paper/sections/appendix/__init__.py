"""The appendix: averages, their tables, the first-order correction."""
