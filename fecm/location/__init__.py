"""Place and force history of an impact from strain gages."""
