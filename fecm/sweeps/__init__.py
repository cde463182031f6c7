"""Many impacts of one deck, varied."""
