"""Cost laws, trial runs and ranking: what `pick` does; imports `references`."""
