"""Independent oracle for the tests: the physics from first principles; and helpers that several tests share."""
