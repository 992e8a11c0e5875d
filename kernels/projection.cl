// Projection of 3D Gaussians to records on the screen (see footprint.cl), culling, and the number of
// tiles that each one reaches.
//
// LANES Gaussians per work-item, n in all. A Gaussian that is not drawn gets the last depth key, no
// tiles and radius 0. Keys are the bits of the depth, which sort like positive floats.
// Compile-time: see footprint.cl and tiles.cl.
#include "footprint.cl"
#include "tiles.cl"
#line 11 "projection.cl"

#define HIDDEN_KEY 0xffffffffu

typedef struct {
  I drawn;
  F x, y, a, b, c, l, det;  // of the record, see blending.cl
  F radius;                 // px, the larger half side of the bounding box
} Screen;

// Every value is checked before a tile is counted or a key is made of it.
Screen to_screen(const Footprint *f, const F opacity_logit, const float4 intrinsics,
                 const int2 size) {
  Screen s;
  s.l = log2_compensation(f) - log2_f(1.0f + exp_f(-opacity_logit));
  const F above = s.l - LOG2_ALPHA_MIN;  // culled where negative, before the root
  const F reach = sqrt(fmax(above, (F)0.0f) * (2.0f / LOG2_E));
  const F rx = reach * sqrt(f->xx), ry = reach * sqrt(f->yy);
  s.radius = fmax(rx, ry);
  s.x = fma(intrinsics.x, f->t.x / f->t.z, (F)intrinsics.z);
  s.y = fma(intrinsics.y, f->t.y / f->t.z, (F)intrinsics.w);
  // exp_f clamps a NaN away, so the logit is asked itself.
  s.drawn = f->valid && opacity_logit == opacity_logit && above >= 0.0f && rx + ry + fabs(s.x) + fabs(s.y) < 1e9f &&
            s.x + rx > 0.0f && s.x - rx < (float)size.x && s.y + ry > 0.0f &&
            s.y - ry < (float)size.y;
  const F k = (0.5f * LOG2_E) / f->det;
  s.a = -k * f->yy;
  s.b = 2.0f * k * f->xy;
  s.c = -k * f->xx;
  s.det = (0.5f * LOG2_E) * k;
  return s;
}

__kernel void project_gaussians(const int n, const float16 view, const float4 intrinsics,
                                const int2 size, __global const float *means,
                                __global const float *quats, __global const float *log_scales,
                                __global const float *opacity_logits, __global float *records,
                                __global uint *depth_keys, __global int *tile_counts,
                                __global int *radii) {
  const int first = get_global_id(0) * LANES;
  if (first >= n) return;
  const Footprint f = footprint(first, n, view, intrinsics, size, means, quats, log_scales);
  const Screen s =
      to_screen(&f, load_field(opacity_logits, first, n, 1, 0), intrinsics, size);
  store_field(s.x, records, first, n, 8, 0);
  store_field(s.y, records, first, n, 8, 1);
  store_field(s.a, records, first, n, 8, 2);
  store_field(s.b, records, first, n, 8, 3);
  store_field(s.c, records, first, n, 8, 4);
  store_field(s.l, records, first, n, 8, 5);
  store_field(f.t.z, records, first, n, 8, 6);
  store_field(s.det, records, first, n, 8, 7);
  // A negative radius marks what is not drawn.
  store_field(s.drawn ? s.radius : (F)-1.0f, (__global float *)radii, first, n, 1, 0);
  for (int i = first; i < min(first + LANES, n); ++i) {
    const float radius = ((__global float *)radii)[i];
    const float8 record = vload8(i, records);
    const int count = radius >= 0.0f ? count_tiles(record, size) : 0;
    tile_counts[i] = count;
    radii[i] = count ? (int)ceil(radius) : 0;
    depth_keys[i] = count ? as_uint(RECORD_DEPTH(record)) : HIDDEN_KEY;
  }
}
