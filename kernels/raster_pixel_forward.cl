// Alpha blending of sorted Gaussians, one work-item per pixel and one work-group per 16x16 tile: the
// mapping for GPUs. Same arithmetic, arguments and results as raster_block_forward.cl.
//
// The work-group fetches CHUNK records into local memory together, then each pixel walks them. It
// stops when every pixel is finished; `used[tile]` receives how many Gaussians were looked at.
// Compile-time: CHANNELS, CHUNK (the size of the work-group), TILE and those of blending.cl.
#include "blending.cl"
#line 9 "raster_pixel_forward.cl"

__kernel __attribute__((reqd_work_group_size(CHUNK, 1, 1))) void raster_forward(
    const int2 size, const int tiles_x, __global const int2 *ranges,
    __global const int *sorted_ids, __global const float *records, __global const float *colors,
    __global float *image, __global float *alpha, __global float *depth, __global int *used) {
  __local float8 record[CHUNK];
  __local int id[CHUNK];
  __local int open;
  const int tile = get_group_id(0), item = get_local_id(0);
  const int x = (tile % tiles_x) * TILE + item % TILE, y = (tile / tiles_x) * TILE + item / TILE;
  const int inside = x < size.x && y < size.y;
  const int2 range = ranges[tile];
  float T = inside ? 1.0f : 0.0f;  // 0 once the pixel is finished
  float alpha_sum = 0.0f, depth_sum = 0.0f, sums[CHANNELS];
  for (int k = 0; k < CHANNELS; ++k) sums[k] = 0.0f;
  int begin = range.x;
  for (; begin < range.y; begin += CHUNK) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item == 0) open = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (T > 0.0f) open = 1;  // every writer writes the same
    if (begin + item < range.y) {
      id[item] = sorted_ids[begin + item];
      record[item] = vload8(id[item], records);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (!open) break;
    const int count = min(CHUNK, range.y - begin);
    for (int i = 0; i < count && T > 0.0f; ++i) {
      const float8 r = record[i];
      const float a =
          alpha_pixel(log2_alpha_pixel(r, RECORD_X(r) - (x + 0.5f), RECORD_Y(r) - (y + 0.5f)));
      if (a == 0.0f) continue;
      const float after = fma(-a, T, T), weight = a * T;
      T = after >= TRANSMITTANCE_MIN ? after : 0.0f;
      if (T == 0.0f) break;
      alpha_sum += weight;
      depth_sum = fma(weight, RECORD_DEPTH(r), depth_sum);
      for (int k = 0; k < CHANNELS; ++k)
        sums[k] = fma(weight, colors[(size_t)id[i] * CHANNELS + k], sums[k]);
    }
  }
  if (item == 0) used[tile] = min(begin, range.y) - range.x;
  if (!inside) return;
  const size_t pixel = (size_t)y * size.x + x;
  alpha[pixel] = alpha_sum;
  depth[pixel] = depth_sum;
  for (int k = 0; k < CHANNELS; ++k) image[pixel * CHANNELS + k] = sums[k];
}
