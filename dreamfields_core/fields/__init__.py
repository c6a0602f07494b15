"""Radiance fields: density and colour at points in space (paper sections 3.1 and 4.7)."""

from dreamfields_core.fields.build import build_field
from dreamfields_core.fields.contract import Field

__all__ = ["Field", "build_field"]
