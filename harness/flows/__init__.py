"""How well scenes in linear flows are solved: against shear, closed results and an integration of its own."""
