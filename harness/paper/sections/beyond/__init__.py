"""Beyond the paper: where bodies end, basins, the order of averaging."""
