"""One module per form of the equations, and the kinematics they share; imports the base types of `models`."""
