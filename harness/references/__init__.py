"""Certified references and errors against them; imports `common`."""
