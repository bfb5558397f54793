"""One module per form of the equations, and what they share; imports the base types of `models` and `free_top`."""
