"""AgX as OpenCL C and as GLSL, written out from the constants that the Python form uses.

Both languages share one body: the formula at the four corners of a tetrahedron of the 57³ lattice,
so that no table has to be uploaded. `kernels/agx.clh` is this module's output
(`python -m luxcore.light.agx_source` writes it again); a test holds the two equal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from luxcore.light import agx_constants as k

HEADER_PATH = Path(__file__).parents[2] / "kernels" / "agx.clh"

_OPENCL = """\
// AgX: linear Rec.709 radiance (float3) to an sRGB-encoded display colour in 0..1.
//
// Written by `python -m luxcore.light.agx_source`: change that, not this.
// Twin: luxcore.light.agx.agx. The formula at four corners of a lattice with half-stop nodes,
// joined linearly, as the published OpenColorIO table is. No compile-time parameters.
#ifndef LUX_AGX_CLH
#define LUX_AGX_CLH

#define AGX_FN static inline
#define AGX_VEC float3
#define AGX_V3(x, y, z) ((float3)(x, y, z))
#define AGX_ALL(v) ((float3)(v))
"""

_GLSL = """\
// AgX: linear Rec.709 radiance (vec3) to an sRGB-encoded display colour in 0..1.
// Twin: luxcore.light.agx.agx. GLSL ES 3.00: call agx(colour) in a fragment shader.
#define AGX_FN
#define AGX_VEC vec3
#define AGX_V3(x, y, z) vec3(x, y, z)
#define AGX_ALL(v) vec3(v)
"""

_BODY = """\
AGX_FN float agx_max3(AGX_VEC c) { return max(c.x, max(c.y, c.z)); }
AGX_FN float agx_min3(AGX_VEC c) { return min(c.x, min(c.y, c.z)); }

AGX_FN float agx_luminance(AGX_VEC c, AGX_VEC weights, bool fade) {
    float luminance = dot(c, weights);
    AGX_VEC opponent = AGX_ALL(agx_max3(c)) - c;
    float missing = agx_max3(opponent) - dot(opponent, weights);
    float share = fade ? pow(clamp(luminance, @tiny@, @one@), @fade@) : @zero@;
    return luminance + (@one@ - share) * missing;
}

AGX_FN AGX_VEC agx_guard_rail(AGX_VEC c, AGX_VEC weights, bool fade) {
    float lowest = agx_min3(c);
    if (lowest >= @zero@) return c;
    AGX_VEC lifted = c - AGX_ALL(lowest);
    float before = agx_luminance(c, weights, fade);
    float after = agx_luminance(lifted, weights, fade);
    return lifted * clamp(before / max(after, @tiny@), @zero@, @one@);
}

AGX_FN float agx_curve(float radiance) {
    float x = (log2(max(radiance, @floor@) / @grey@) - @min_ev@) / @span_ev@;
    float scale = x < @pivot_x@ ? @toe@ : @shoulder@;
    float term = @slope@ * (x - @pivot_x@) / scale;
    float rise = term / pow(@one@ + pow(max(term, @zero@), @power@), @power_inverse@);
    return pow(max(scale * rise + @pivot_y@, @zero@), @gamma@);
}

// Encoded colour at one node; `node` counts cells along the E-Gamut axes.
AGX_FN AGX_VEC agx_node(AGX_VEC node) {
    AGX_VEC e = @grey@ * exp2(node * @stops_per_cell@ + AGX_ALL(@min_ev@));
    AGX_VEC wide = AGX_V3(@REC2020_FROM_E * e@);
    AGX_VEC railed = agx_guard_rail(wide, AGX_V3(@LUMINANCE_2020@), false);
    AGX_VEC scene = AGX_V3(@INSET * railed@);
    AGX_VEC formed = AGX_V3(agx_curve(scene.x), agx_curve(scene.y), agx_curve(scene.z));
    float low = agx_min3(scene);
    float span = agx_max3(scene) - low;
    if (span > @grey_span@ * (low + span)) {
        float formed_low = agx_min3(formed);
        float formed_span = agx_max3(formed) - formed_low;
        AGX_VEC kept = AGX_ALL(formed_low) + (scene - AGX_ALL(low)) * (formed_span / span);
        formed = mix(kept, formed, @hue_mix@);
    }
    AGX_VEC narrow = AGX_V3(@REC709_FROM_SCENE * formed@);
    AGX_VEC shown = agx_guard_rail(narrow, AGX_V3(@LUMINANCE_709@), true);
    return pow(clamp(shown, @zero@, @one@), AGX_ALL(@gamma_inverse@));
}

AGX_FN float agx_srgb(float v) {
    return v <= @srgb_knee@ ? v * @srgb_slope@ : @srgb_gain@ * pow(v, @gamma_inverse@) - @srgb_off@;
}

AGX_FN AGX_VEC agx(AGX_VEC radiance) {
    AGX_VEC bounded = clamp(radiance, AGX_ALL(-@ceiling@), AGX_ALL(@ceiling@));
    AGX_VEC e = clamp(AGX_V3(@E_FROM_709 * bounded@), AGX_ALL(@floor@), AGX_ALL(@ceiling@));
    AGX_VEC position = (log2(e / @grey@) - AGX_ALL(@min_ev@)) * @cells_per_stop@;
    AGX_VEC base = min(floor(position), AGX_ALL(@last_cell@));
    AGX_VEC f = position - base;
    AGX_VEC x = AGX_V3(@one@, @zero@, @zero@);
    AGX_VEC y = AGX_V3(@zero@, @one@, @zero@);
    AGX_VEC z = AGX_V3(@zero@, @zero@, @one@);
    AGX_VEC first = f.x >= f.y ? (f.x >= f.z ? x : z) : (f.y >= f.z ? y : z);
    AGX_VEC last = (f.z <= f.y && f.z <= f.x) ? z : (f.y <= f.x ? y : x);
    float high = agx_max3(f);
    float low = agx_min3(f);
    float middle = f.x + f.y + f.z - high - low;
    AGX_VEC encoded = agx_node(base) * (@one@ - high)
        + agx_node(base + first) * (high - middle)
        + agx_node(base + AGX_ALL(@one@) - last) * (middle - low)
        + agx_node(base + AGX_ALL(@one@)) * low;
    AGX_VEC light = pow(max(encoded, AGX_ALL(@zero@)), AGX_ALL(@gamma@));
    return AGX_V3(agx_srgb(light.x), agx_srgb(light.y), agx_srgb(light.z));
}
"""


def opencl_source() -> str:
    """The text of `kernels/agx.clh`."""
    return f"{_OPENCL}\n{_fill('f')}\n#endif\n"


def glsl_source() -> str:
    """GLSL ES 3.00 text that defines `vec3 agx(vec3 radiance)`."""
    return f"{_GLSL}\n{_fill('')}"


def _fill(suffix: str) -> str:
    text = _BODY
    for name, value in _scalars().items():
        text = text.replace(f"@{name}@", _literal(value, suffix))
    for name, weights in (("LUMINANCE_2020", k.LUMINANCE_2020), ("LUMINANCE_709", k.LUMINANCE_709)):
        text = text.replace(f"@{name}@", ", ".join(_literal(w, suffix) for w in weights))
    for name, (matrix, vector) in _products().items():
        rows = ",\n        ".join(_row(row, vector, suffix) for row in matrix)
        text = text.replace(f"@{name} * {vector}@", rows)
    return text


def _scalars() -> dict[str, float]:
    span = k.MAX_EV - k.MIN_EV
    lattice_span, cells = k.LATTICE_MAX_EV - k.LATTICE_MIN_EV, k.LATTICE_SIZE - 1
    return {
        "zero": 0.0, "one": 1.0, "tiny": 1e-12, "grey": k.MIDDLE_GREY, "grey_span": 1e-6,
        "min_ev": k.MIN_EV, "span_ev": span, "floor": k.LINEAR_FLOOR,
        "ceiling": k.MIDDLE_GREY * 2.0**k.LATTICE_MAX_EV,
        "pivot_x": k.PIVOT_X, "pivot_y": k.PIVOT_Y, "slope": k.SLOPE,
        "toe": k.TOE_SCALE, "shoulder": k.SHOULDER_SCALE,
        "power": k.POWER, "power_inverse": 1.0 / k.POWER,
        "gamma": k.DISPLAY_GAMMA, "gamma_inverse": 1.0 / k.DISPLAY_GAMMA,
        "hue_mix": k.HUE_MIX, "fade": k.COMPENSATION_POWER,
        "stops_per_cell": lattice_span / cells, "cells_per_stop": cells / lattice_span,
        "last_cell": cells - 1.0,
        "srgb_knee": 0.0031308, "srgb_slope": 12.92, "srgb_gain": 1.055, "srgb_off": 0.055,
    }  # fmt: skip


def _products() -> dict[str, tuple[np.ndarray, str]]:
    return {
        "REC2020_FROM_E": (k.REC2020_FROM_709 @ k.REC709_FROM_E, "e"),
        "INSET": (k.INSET, "railed"),
        "REC709_FROM_SCENE": (k.REC709_FROM_2020 @ k.OUTSET, "formed"),
        "E_FROM_709": (k.E_FROM_709, "bounded"),
    }


def _row(row: np.ndarray, vector: str, suffix: str) -> str:
    terms = (f"{_literal(v, suffix)} * {vector}.{c}" for v, c in zip(row, "xyz", strict=True))
    return " + ".join(terms)


def _literal(value: float, suffix: str) -> str:
    text = f"{value:.9g}"
    if not any(c in text for c in ".e"):
        text += ".0"
    return f"({text}{suffix})" if value < 0 else f"{text}{suffix}"


if __name__ == "__main__":
    HEADER_PATH.write_text(opencl_source(), encoding="utf-8")
