"""Classical test problems with published solutions, one file per family."""
