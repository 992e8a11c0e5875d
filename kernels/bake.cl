// Blending weights of a view as a sparse matrix W [pixels, Gaussians]: while geometry is frozen,
// image = W · lights for any lights, and the gradient by lights is Wᵀ · d_image (paper, stage 2
// "light fitting").
//
// weights_count and weights_fill walk the sorted lists of the forward pass, one work-item per 4x4
// block of pixels; they see the alphas and stop where raster_forward does. apply and
// apply_transposed gather, one work-item per row, over CHANNELS values in float16s: they read up to
// 16 floats beyond the last row, so such arrays are allocated with 16 rows to spare.
// Compile-time: CHANNELS, ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN, LOG2_ALPHA_MIN, TILE;
// HALF_WEIGHTS where apply reads weights of 16 bits.
#include "blending.cl"
#line 14 "bake.cl"

#define LANE_X ((float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define LANE_Y ((float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))

typedef struct {
  int x0, y0;     // first pixel of the block
  int2 range;     // the sorted Gaussians of its tile
  float16 px, py; // pixel centres
  float16 T;      // 0 once the pixel is finished
} Block;

Block open_block(const int2 size, __global const int2 *ranges) {
  const int blocks_x = (size.x + 3) / 4, tiles_x = (size.x + TILE - 1) / TILE;
  Block b;
  b.x0 = ((int)get_global_id(0) % blocks_x) * 4;
  b.y0 = ((int)get_global_id(0) / blocks_x) * 4;
  b.range = ranges[(b.y0 / TILE) * tiles_x + b.x0 / TILE];
  b.px = b.x0 + 0.5f + LANE_X;
  b.py = b.y0 + 0.5f + LANE_Y;
  b.T = (b.px < size.x && b.py < size.y) ? (float16)(1.0f) : (float16)(0.0f);
  return b;
}

// The weights of the next Gaussian in the block, 0 where it is not drawn.
float16 next_weight(Block *b, const float8 r) {
  const float16 alpha = alpha_block(log2_alpha_block(r, RECORD_X(r) - b->px, RECORD_Y(r) - b->py));
  const float16 after = fma(-alpha, b->T, b->T);
  const int16 drawn = after >= TRANSMITTANCE_MIN;
  const float16 weight = drawn ? alpha * b->T : (float16)(0.0f);
  b->T = drawn ? after : (float16)(0.0f);
  return weight;
}

__kernel void weights_count(const int2 size, __global const int2 *ranges,
                            __global const int *sorted_ids, __global const float *records,
                            __global int *counts) {
  Block b = open_block(size, ranges);
  int16 count = (int16)(0);
  for (int i = b.range.x; i < b.range.y && any(b.T > 0.0f); ++i)
    count -= next_weight(&b, vload8(sorted_ids[i], records)) > 0.0f;
  for (int lane = 0; lane < 16; ++lane) {
    const int x = b.x0 + (lane & 3), y = b.y0 + (lane >> 2);
    if (x < size.x && y < size.y) counts[y * size.x + x] = ((int *)&count)[lane];
  }
}

// `start` [pixels + 1] says where each pixel's entries go, nearest Gaussian first.
__kernel void weights_fill(const int2 size, __global const int2 *ranges,
                           __global const int *sorted_ids, __global const float *records,
                           __global const int *start, __global int *ids,
                           __global float *weights) {
  Block b = open_block(size, ranges);
  int next[16];
  for (int lane = 0; lane < 16; ++lane) {
    const int x = min(b.x0 + (lane & 3), size.x - 1), y = min(b.y0 + (lane >> 2), size.y - 1);
    next[lane] = start[y * size.x + x];
  }
  for (int i = b.range.x; i < b.range.y && any(b.T > 0.0f); ++i) {
    const int id = sorted_ids[i];
    const float16 weight = next_weight(&b, vload8(id, records));
    if (!any(weight > 0.0f)) continue;
    for (int lane = 0; lane < 16; ++lane) {
      const float w = ((const float *)&weight)[lane];
      if (w <= 0.0f) continue;
      ids[next[lane]] = id;
      weights[next[lane]] = w;
      ++next[lane];
    }
  }
}

#ifdef HALF_WEIGHTS
#define WEIGHT(weights, entry) vload_half(entry, (__global const half *)(weights))
#else
#define WEIGHT(weights, entry) (weights)[entry]
#endif

// out [rows, CHANNELS] = W values. Rows are pixels, or Gaussians for the transposed matrix. One
// float16 of channels at a time: with several, the sums would not stay in registers.
__kernel void apply(__global const int *start, __global const int *others,
                    __global const float *weights, __global const float *values, const int rows,
                    __global float *out) {
  const int row = get_global_id(0);
  if (row >= rows) return;
  for (int first = 0; first < CHANNELS; first += 16) {
    float16 sum = (float16)(0.0f);
    for (int e = start[row]; e < start[row + 1]; ++e)
      sum = fma(WEIGHT(weights, e), vload16(0, values + (size_t)others[e] * CHANNELS + first), sum);
    for (int c = first; c < min(first + 16, CHANNELS); ++c)
      out[(size_t)row * CHANNELS + c] = ((float *)&sum)[c - first];
  }
}
