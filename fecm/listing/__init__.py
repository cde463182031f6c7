"""The printed program of the report: its slips, what they change, its printed output and tapes."""
