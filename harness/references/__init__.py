"""Certified references and errors against them. Of the harness it may import `common` alone."""
