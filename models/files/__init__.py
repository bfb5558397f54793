"""Scene files, and how any TOML file is read and checked; imports the base types of `models`."""
