"""A deck checked, meshed and built."""
