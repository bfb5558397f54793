"""Classical test problems with published solutions: a table of `problems.toml` for each."""
