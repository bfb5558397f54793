"""How good averaging is, to first and second order: three studies; imports `api`."""
