// Projection of 3D Gaussians to records on the screen (see footprint.cl), culling, and the number of
// tiles that each one reaches.
//
// One work-item per Gaussian, n of them. A Gaussian that is not drawn gets the last depth key, no
// tiles and radius 0. Keys are the bits of the depth, which sort like positive floats.
// Compile-time: see footprint.cl and tiles.cl.
#include "footprint.cl"
#include "tiles.cl"
#line 10 "projection.cl"

#define HIDDEN_KEY 0xffffffffu
#define LOG2_E 1.4426950408889634f

// False where nothing is drawn; every value is checked before a tile is counted or a key made.
int make_record(const Footprint *f, const float opacity_logit, const float4 intrinsics,
                const int2 size, float8 *record, float2 *extent) {
  const float opacity = compensation(f) / (1.0f + exp(-opacity_logit));
  if (!(opacity >= ALPHA_MIN)) return 0;  // before the logarithm
  const float l = log2(opacity);
  const float reach = sqrt((2.0f / LOG2_E) * (l - LOG2_ALPHA_MIN));
  *extent = reach * (float2)(sqrt(f->xx), sqrt(f->yy));
  const float mx = intrinsics.x * f->t.x / f->t.z + intrinsics.z;
  const float my = intrinsics.y * f->t.y / f->t.z + intrinsics.w;
  if (!isfinite(extent->x + extent->y + mx + my)) return 0;
  if (mx + extent->x <= 0 || mx - extent->x >= size.x) return 0;
  if (my + extent->y <= 0 || my - extent->y >= size.y) return 0;
  const float k = 0.5f * LOG2_E / f->det;
  *record = (float8)(mx, my, -k * f->yy, 2.0f * k * f->xy, -k * f->xx, l, f->t.z,
                     0.5f * LOG2_E * k);
  return 1;
}

__kernel void project_gaussians(const int n, const float16 view, const float4 intrinsics,
                                const int2 size, __global const float *means,
                                __global const float *quats, __global const float *log_scales,
                                __global const float *opacity_logits, __global float *records,
                                __global uint *depth_keys, __global int *tile_counts,
                                __global int *radii) {
  const int i = get_global_id(0);
  if (i >= n) return;
  Footprint f;
  float8 record;
  float2 extent;
  if (!footprint(vload3(i, means), vload4(i, quats), vload3(i, log_scales), view, intrinsics, size,
                 &f) ||
      !make_record(&f, opacity_logits[i], intrinsics, size, &record, &extent)) {
    radii[i] = 0;
    tile_counts[i] = 0;
    depth_keys[i] = HIDDEN_KEY;
    return;
  }
  TileRows rows = tile_rows(record, size);
  int count = 0;
  for (int row = rows.first; row < rows.end; ++row) {
    const int2 span = tile_span(&rows, row);
    count += span.y - span.x;
  }
  vstore8(record, i, records);
  tile_counts[i] = count;
  radii[i] = count ? (int)fmin(ceil(fmax(extent.x, extent.y)), 1e9f) : 0;
  depth_keys[i] = count ? as_uint(f.t.z) : HIDDEN_KEY;
}
