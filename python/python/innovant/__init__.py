"""State-space models with honest uncertainty from recordings, also in closed loop."""

from ._innovant import Model, __version__, identify

__all__ = ["Model", "__version__", "identify"]
