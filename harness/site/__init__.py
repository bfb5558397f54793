"""The offline web site of everything found so far (`polhode report`)."""
