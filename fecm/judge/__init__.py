"""Judgement of results: limits of the model, ends of a run, verdicts, and their words."""
