"""Vector fields in machine code: traced, compiled, called from C and from Python; imports `models` alone."""
