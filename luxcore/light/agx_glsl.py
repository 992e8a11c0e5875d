"""AgX for the browser."""

from __future__ import annotations

from luxcore.light.agx_source import glsl_source


def source() -> str:
    """GLSL ES 3.00 text that defines `vec3 agx(vec3 radiance)`: linear Rec.709 to sRGB display."""
    return glsl_source()
