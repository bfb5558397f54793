"""How good averaging is, to first and second order: one study; imports `api`."""
