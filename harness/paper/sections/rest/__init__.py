"""Particles released from rest."""
