"""From a configuration to its field."""

from __future__ import annotations

from dreamfields_core.config import FieldConfig, HybridConfig
from dreamfields_core.fields.contract import Field
from dreamfields_core.fields.hybrid import hybrid
from dreamfields_core.fields.residual_mlp import residual_mlp


def build_field(config: FieldConfig, *, bound: float) -> Field:
    """The field that `config` names, for a scene of half-side `bound`."""
    if isinstance(config, HybridConfig):
        return hybrid(config, bound=bound)
    return residual_mlp(config)
