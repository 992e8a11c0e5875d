// Derivative of the blending, one work-item per pixel and one work-group per 16x16 tile: the mapping
// for GPUs. Same equations, arguments and results as raster_block_backward.cl.
//
// For each Gaussian, the work-group adds its pixels' moments and feature gradients by a tree in local
// memory, SUMS_AT_ONCE at a time: a fixed order, no atomics. A Gaussian that no pixel of the tile
// sees costs one barrier and leaves its row untouched.
// Compile-time: CHANNELS, WITH_DEPTH, PARTIAL_SIZE, CHUNK (the size of the work-group), TILE.
#define FEATURES (CHANNELS + WITH_DEPTH)
#define MOMENTS 6
#define SUMS (MOMENTS + FEATURES)
#define SUMS_AT_ONCE 4
#define ROUNDS ((SUMS + SUMS_AT_ONCE - 1) / SUMS_AT_ONCE)
#include "blending.cl"
#line 15 "raster_pixel_backward.cl"

// The sum of every work-item's `value`, in work-item 0.
inline float4 sum_group(const float4 value, __local float4 *shared) {
  const int item = get_local_id(0);
  shared[item] = value;
  for (int reach = CHUNK / 2; reach > 0; reach /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < reach) shared[item] += shared[item + reach];
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  const float4 sum = shared[0];
  barrier(CLK_LOCAL_MEM_FENCE);
  return sum;
}

__kernel __attribute__((reqd_work_group_size(CHUNK, 1, 1))) void raster_backward(
    const int2 size, const int tiles_x, __global const int2 *ranges,
    __global const int *sorted_ids, __global const float *records, __global const float *colors,
    __global const int *used, __global const float *image, __global const float *alpha,
    __global const float *depth, __global const float *d_image, __global const float *d_alpha,
    __global const float *d_depth, __global float *partials, __global uchar *touched) {
  __local float4 shared[CHUNK];
  __local int seen[2];
  const int tile = get_group_id(0), item = get_local_id(0);
  const int x = (tile % tiles_x) * TILE + item % TILE, y = (tile / tiles_x) * TILE + item / TILE;
  const int inside = x < size.x && y < size.y;
  const size_t pixel = inside ? (size_t)y * size.x + x : 0;
  const int end = ranges[tile].x + used[tile];
  float T = inside ? 1.0f : 0.0f, d_features[FEATURES];
  const float d_a = inside && d_alpha ? d_alpha[pixel] : 0.0f;
  float rest = d_a * alpha[pixel];
  for (int k = 0; k < CHANNELS; ++k) {
    d_features[k] = inside ? d_image[pixel * CHANNELS + k] : 0.0f;
    rest = fma(d_features[k], image[pixel * CHANNELS + k], rest);
  }
#if WITH_DEPTH
  d_features[CHANNELS] = inside ? d_depth[pixel] : 0.0f;
  rest = fma(d_features[CHANNELS], depth[pixel], rest);
#endif
  if (item == 0) seen[0] = seen[1] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int row = ranges[tile].x; row < end; ++row) {
    const int id = sorted_ids[row], flag = row & 1;
    const float8 r = vload8(id, records);
    const float dx = RECORD_X(r) - (x + 0.5f), dy = RECORD_Y(r) - (y + 0.5f);
    const float a = alpha_pixel(log2_alpha_pixel(r, dx, dy));
    const float after = fma(-a, T, T);
    const int drawn = a > 0.0f && T > 0.0f && after >= TRANSMITTANCE_MIN;
    const float weight = drawn ? a * T : 0.0f;
    if (drawn) seen[flag] = 1;
    if (item == 0) seen[1 - flag] = 0;
    if (a > 0.0f) T = drawn ? after : 0.0f;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!seen[flag]) {
      barrier(CLK_LOCAL_MEM_FENCE);  // nobody clears the flag that another still reads
      continue;
    }
    float s = d_a;
    for (int k = 0; k < CHANNELS; ++k)
      s = fma(colors[(size_t)id * CHANNELS + k], d_features[k], s);
#if WITH_DEPTH
    s = fma(RECORD_DEPTH(r), d_features[CHANNELS], s);
#endif
    const float own = weight * s;
    rest -= own;
    const float h = drawn && a < ALPHA_MAX ? own - rest * (a / (1.0f - a)) : 0.0f;
    float sums[ROUNDS * SUMS_AT_ONCE] = {h, h * dx, h * dy, h * dx * dx, h * dx * dy, h * dy * dy};
    for (int k = 0; k < FEATURES; ++k) sums[MOMENTS + k] = weight * d_features[k];
    for (int k = SUMS; k < ROUNDS * SUMS_AT_ONCE; ++k) sums[k] = 0.0f;
    for (int k = 0; k < ROUNDS; ++k) {
      const float4 sum = sum_group(vload4(k, sums), shared);
      if (item == 0) vstore4(sum, k, partials + (size_t)row * PARTIAL_SIZE);
    }
    if (item == 0) touched[row] = 1;
  }
}
