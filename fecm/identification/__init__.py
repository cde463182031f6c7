"""Parameters of an impact from a measured force."""
