"""Certified references and errors against them; it imports no folder of the harness but `common`."""
