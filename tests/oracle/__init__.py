"""Independent oracle for the tests: the physics from first principles, without any code of the project."""
