"""Exports: results in the formats of other programs."""


class ExportError(ValueError):
    """A result lacks what an export needs, or the call asks for what there is not."""
