"""What can go wrong between a field and a file: every text is one sentence with the way out."""

from __future__ import annotations


class MeshError(ValueError):
    """Parent of all below."""


class BadResolution(MeshError):
    """A lattice that cannot be refined from a coarse one, or a bound that is no size."""


class FieldNotFinite(MeshError):
    """The field gave NaN or infinity, or not one number a point."""


class FieldEmpty(MeshError):
    """Nothing in the cube lies above the level."""


class FieldFull(MeshError):
    """Nothing in the cube lies below the level."""


class SilhouetteEmpty(MeshError):
    """No camera sees anything opaque, so no level can be chosen."""


class BadBudget(MeshError):
    """A face budget that no closed surface can meet."""


class BadMesh(MeshError):
    """Arrays that are no triangle mesh."""


class MeshCleaningFailed(MeshError):
    """The native mesh library failed, crashed, timed out or is not installed whole."""
