"""The page in a dream's folder that shows its object in 3D, offline."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dreamfields_core.reporting.viewer import object_page

VIEW = "view.html"
STILL = "turntable.webp"
SHOWN = ("mesh.glb", "mesh_turntable.mp4", "turntable.mp4", "turntable_depth.mp4", "turntable_transmittance.mp4", "contact_sheet.png")
"""Files of the folder that the page offers, in this order."""


def view_page(result: dict[str, Any], glb: bytes, files: Sequence[str]) -> bytes:
    """The page. result: what result.json says. glb: the mesh. files: names in the folder."""
    lighter = sorted(name for name in files if name.startswith("mesh_lod"))
    offered = [name for name in SHOWN if name in files]
    page = object_page(
        glb,
        caption=result["caption"],
        facts=facts(result),
        files=[*offered[:1], *lighter, *offered[1:], "result.json"],
        still=STILL if STILL in files else None,
    )
    return page.encode()


def facts(result: dict[str, Any]) -> dict[str, str | int | float]:
    """What stands below the object, by name."""
    counts = result["mesh"]["mesh"]
    told: dict[str, str | int | float] = {
        f"{judge} ranks it": f"{score['rank']} of {score['pool']} (cosine {score['cosine']:.3f})"
        for judge, score in result["scores"].items()
    }
    return told | {
        "faces": counts["faces"],
        "closed": "yes" if counts["watertight"] else "no",
        "preset": result["preset"],
        "seed": result["seed"],
        "guided by": result["encoders"]["guidance"]["name"],
        "configuration": result["config_digest"][:12],
    }
