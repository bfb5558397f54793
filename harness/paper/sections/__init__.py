"""The claims of each section of the paper, a file for each, and what computes for them; imports `paper`."""
