"""The version, alone in a file so that asking for it imports nothing else.

The build writes it from the tag; a checkout that was never built has that of the last release.
"""

try:
    from fecm._built_version import __version__ as found
except ImportError:
    found = "0.1.0"

__version__: str = found
