"""The paper, reproduced: every figure and table of it from this code, with a measured verdict on each claim."""
