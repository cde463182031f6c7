"""Numerics of plate, projectile and contact."""
