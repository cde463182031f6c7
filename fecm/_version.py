"""The version, in its own file so that reading it imports nothing else.

The build writes it from the tag. A checkout that was never built has the version of the last
release.
"""

from importlib import import_module

try:
    __version__: str = import_module("fecm._built_version").__version__
except ImportError:
    __version__ = "0.1.0"
