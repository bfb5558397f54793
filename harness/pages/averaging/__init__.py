"""Pages of averaging: to first and to second order, and the form of several segments."""
