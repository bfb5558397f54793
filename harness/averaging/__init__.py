"""How good averaging is, over random bodies, and of second order and `hybrid` in more depth; imports `api`."""
