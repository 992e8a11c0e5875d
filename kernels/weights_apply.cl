// Baked blending weights of a view (weights_bake.cl) applied while geometry is frozen: image =
// W · lights for any lights, and the gradient by lights is Wᵀ · d_image (paper, stage 2 "light
// fitting").
//
// Channels are the lanes: a quad keeps GROUP float8s of channels of its four pixels in registers,
// and each entry costs one fused multiply-add per pixel and float8 in either direction. Sums run in
// the order of raster_forward, so images are equal to the bit. weights_render and weights_gather
// take one work-item per tile. Lights and images are read in whole groups: up to STRIDE - CHANNELS
// floats beyond the last one must be readable.
// Compile-time: CHANNELS, TILE, GROUP_VECTORS; HALF_WEIGHTS 1 where weights have 16 bits.
#include "common.cl"
#line 13 "weights_apply.cl"

#define QUADS_PER_TILE 64
#if HALF_WEIGHTS
typedef half Weight;
#define LOAD_WEIGHTS(w, e) \
  float w[4];              \
  vstore4(vload_half4(e, weights), 0, w)
#else
typedef float Weight;
#define LOAD_WEIGHTS(w, e) __global const float *w = weights + 4 * (size_t)(e)
#endif
#define VECTORS ((CHANNELS + 7) / 8)
// Equal groups of at most GROUP_VECTORS float8s: four pixels of more would not fit the registers.
#define GROUPS ((VECTORS + GROUP_VECTORS - 1) / GROUP_VECTORS)
#define GROUP ((VECTORS + GROUPS - 1) / GROUPS)
#define STRIDE (8 * GROUPS * GROUP)  // floats of a row of partial sums

// Of pixel k of the tile's quad q.
inline int2 pixel_of(const int tile, const int tiles_x, const int q, const int k) {
  const int b = q >> 2;
  return (int2)((tile % tiles_x) * TILE + (b & 3) * 4 + (q & 1) * 2 + (k & 1),
                (tile / tiles_x) * TILE + (b >> 2) * 4 + (q & 2) + (k >> 1));
}

// image [h, w, CHANNELS] = W · lights [n, CHANNELS]; ids [rows] is the Gaussian of each row.
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void weights_render(
    const int2 size, const int tiles_x, __global const int *start, __global const int *rows,
    __global const Weight *weights, __global const int *ids, __global const float *lights,
    __global float *image) {
  const int tile = get_global_id(0);
  for (int q = 0; q < QUADS_PER_TILE; ++q) {
    const int begin = start[tile * QUADS_PER_TILE + q], end = start[tile * QUADS_PER_TILE + q + 1];
    for (int first = 0; first < VECTORS; first += GROUP) {
      float8 sum[4][GROUP];
#pragma unroll
      for (int k = 0; k < 4; ++k)
#pragma unroll
        for (int v = 0; v < GROUP; ++v) sum[k][v] = (float8)(0.0f);
      for (int e = begin; e < end; ++e) {
        __global const float *light = lights + (size_t)ids[rows[e]] * CHANNELS + 8 * first;
        LOAD_WEIGHTS(w, e);
#pragma unroll
        for (int v = 0; v < GROUP; ++v) {
          const float8 l = vload8(v, light);
#pragma unroll
          for (int k = 0; k < 4; ++k) sum[k][v] = fma((float8)(w[k]), l, sum[k][v]);
        }
      }
#pragma unroll
      for (int k = 0; k < 4; ++k) {
        const int2 p = pixel_of(tile, tiles_x, q, k);
        if (p.x >= size.x || p.y >= size.y) continue;
        __global float *out = image + ((size_t)p.y * size.x + p.x) * CHANNELS;
#pragma unroll
        for (int v = 0; v < GROUP; ++v) {
          const int c = 8 * (first + v);
          if (c + 8 <= CHANNELS) {
            vstore8(sum[k][v], 0, out + c);
          } else {
            for (int j = 0; j < CHANNELS - c; ++j) out[c + j] = ((const float *)&sum[k][v])[j];
          }
        }
      }
    }
  }
}

// partials [rows, STRIDE] = Wᵀ · d_image within each tile; row_ranges [tiles + 1].
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void weights_gather(
    const int2 size, const int tiles_x, __global const int *start, __global const int *rows,
    __global const Weight *weights, __global const int *row_ranges, __global const float *d_image,
    __global float *partials) {
  const int tile = get_global_id(0);
  for (int row = row_ranges[tile]; row < row_ranges[tile + 1]; ++row)
#pragma unroll
    for (int v = 0; v < GROUPS * GROUP; ++v)
      vstore8((float8)(0.0f), v, partials + (size_t)row * STRIDE);
  for (int q = 0; q < QUADS_PER_TILE; ++q) {
    const int begin = start[tile * QUADS_PER_TILE + q], end = start[tile * QUADS_PER_TILE + q + 1];
    if (begin == end) continue;
    for (int first = 0; first < VECTORS; first += GROUP) {
      float8 d[4][GROUP];
#pragma unroll
      for (int k = 0; k < 4; ++k) {
        const int2 p = min(pixel_of(tile, tiles_x, q, k), size - 1);
        __global const float *in = d_image + ((size_t)p.y * size.x + p.x) * CHANNELS + 8 * first;
#pragma unroll
        for (int v = 0; v < GROUP; ++v) d[k][v] = vload8(v, in);
      }
      for (int e = begin; e < end; ++e) {
        __global float *out = partials + (size_t)rows[e] * STRIDE + 8 * first;
        LOAD_WEIGHTS(w, e);
#pragma unroll
        for (int v = 0; v < GROUP; ++v) {
          float8 sum = vload8(v, out);
#pragma unroll
          for (int k = 0; k < 4; ++k) sum = fma((float8)(w[k]), d[k][v], sum);
          vstore8(sum, v, out);
        }
      }
    }
  }
}

// d_lights [n, CHANNELS]: the sum of each Gaussian's rows, in the order of tiles. One work-item per
// Gaussian, n of them; gaussian_rows [n + 1] says where each one's rows are in row_order.
__kernel void weights_sum(const int n, __global const int *gaussian_rows,
                          __global const int *row_order, __global const float *partials,
                          __global float *d_lights) {
  const int i = get_global_id(0);
  if (i >= n) return;
  float8 sum[VECTORS];
#pragma unroll
  for (int v = 0; v < VECTORS; ++v) sum[v] = (float8)(0.0f);
  for (int r = gaussian_rows[i]; r < gaussian_rows[i + 1]; ++r)
#pragma unroll
    for (int v = 0; v < VECTORS; ++v)
      sum[v] += vload8(v, partials + (size_t)row_order[r] * STRIDE);
  for (int c = 0; c < CHANNELS; ++c)
    d_lights[(size_t)i * CHANNELS + c] = ((const float *)sum)[c];
}
