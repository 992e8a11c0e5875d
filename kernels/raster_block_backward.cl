// Derivative of the blending, one work-item per 16x16 tile: the mapping for CPUs.
//
// Front to back again, with the same alphas. With s_i = f_i . d_features + d_alpha and
// R_i = sum_{j>i} w_j s_j, known from the forward image,
//   h_i = dL/d ln(alpha_i) = w_i s_i - R_i alpha_i / (1 - alpha_i),
// so nothing divides the transmittance back. Each (Gaussian, tile) pair writes its own row of
// partials, in the order of the sorted lists: the moments of h (see projection_backward.cl), then
// dL/d features. No atomics. touched[row] must be 0 before; rows of Gaussians that no open pixel
// sees stay untouched.
// With COLORS_ONLY, for frozen geometry, a row holds dL/d features alone; image, alpha, depth and
// their gradients other than d_image are not read.
// Compile-time: CHANNELS, COLORS_ONLY, WITH_DEPTH, PARTIAL_SIZE, CHUNK and the constants of blending.cl.
#define FEATURES (CHANNELS + WITH_DEPTH)
#ifndef COLORS_ONLY
#define COLORS_ONLY 0
#endif
#if COLORS_ONLY
#define MOMENTS 0
#else
#define MOMENTS 6
#endif
// Features are summed in equal groups of at most 12, which fit the registers; padding is zero.
#define GROUPS ((FEATURES + 11) / 12)
#define GROUP_SIZE ((FEATURES + GROUPS - 1) / GROUPS)
#define PADDED (GROUPS * GROUP_SIZE)
#define SUM_VECTORS ((MOMENTS + PADDED + 15) / 16)
#include "block_chunk.cl"
#line 17 "raster_block_backward.cl"

typedef struct {
  float16 T;     // 0 once the pixel is finished
  float16 rest;  // R of the next Gaussian, before it is blended
  float16 d_alpha;
  float16 d_features[PADDED];
} Block;

inline float16 fold(const float16 a, const float16 b) {
  return (float16)(a.even + a.odd, b.even + b.odd);
}

// Lane i: the sum of the lanes of v[i], always in the same order.
inline float16 sum_lanes(const float16 *v) {
  const float16 a = fold(fold(v[0], v[1]), fold(v[2], v[3]));
  const float16 b = fold(fold(v[4], v[5]), fold(v[6], v[7]));
  const float16 c = fold(fold(v[8], v[9]), fold(v[10], v[11]));
  const float16 d = fold(fold(v[12], v[13]), fold(v[14], v[15]));
  return fold(fold(a, b), fold(c, d));
}

// Sums the moments; returns the weights, for the features' gradients.
inline float16 blend_backward(Block *block, const float8 r, const float *features,
                              const float16 px, const float16 py, float16 *moments) {
  const float16 dx = RECORD_X(r) - px, dy = RECORD_Y(r) - py;
  const float16 alpha = alpha_block(log2_alpha_block(r, dx, dy));
  const float16 T = block->T, after = fma(-alpha, T, T);
  const int16 drawn = after >= TRANSMITTANCE_MIN;
  const float16 weight = drawn ? alpha * T : (float16)(0.0f);
  block->T = drawn ? after : (float16)(0.0f);
#if !COLORS_ONLY
  // Four sums, as one long chain of additions would wait for itself.
  float16 s[4] = {block->d_alpha, (float16)(0.0f), (float16)(0.0f), (float16)(0.0f)};
#pragma unroll
  for (int k = 0; k < FEATURES; ++k)
    s[k & 3] = fma((float16)(features[k]), block->d_features[k], s[k & 3]);
  const float16 own = weight * ((s[0] + s[1]) + (s[2] + s[3]));
  block->rest -= own;
  const float16 slope = own - block->rest * (alpha / (1.0f - alpha));
  // Where alpha is at its ceiling it does not move with the Gaussian.
  const float16 h = drawn && alpha < ALPHA_MAX ? slope : (float16)(0.0f);
  const float16 hx = h * dx, hy = h * dy;
  moments[0] += h;
  moments[1] += hx;
  moments[2] += hy;
  moments[3] = fma(hx, dx, moments[3]);
  moments[4] = fma(hx, dy, moments[4]);
  moments[5] = fma(hy, dy, moments[5]);
#endif
  return weight;
}

// sums[k] = sum over the blocks in `left` of weight times d_features[first + k].
inline void sum_features(const Block *blocks, const float16 *weights, uint left, const int first,
                         float16 *sums) {
  float16 own[GROUP_SIZE];
#pragma unroll
  for (int k = 0; k < GROUP_SIZE; ++k) own[k] = (float16)(0.0f);
  for (; left; left &= left - 1) {
    const int b = popcount(~left & (left - 1));
    const float16 weight = weights[b];
    const float16 *d_features = blocks[b].d_features + first;
#pragma unroll
    for (int k = 0; k < GROUP_SIZE; ++k) own[k] = fma(weight, d_features[k], own[k]);
  }
#pragma unroll
  for (int k = 0; k < GROUP_SIZE; ++k) sums[k] = own[k];
}

// Lanes outside the image start finished, with zero gradients.
void read_block(Block *block, const int x0, const int y0, const int2 size,
                __global const float *image, __global const float *alpha,
                __global const float *depth, __global const float *d_image,
                __global const float *d_alpha, __global const float *d_depth) {
  float d_features[FEATURES][16], d_alphas[16], rest[16], T[16];
  for (int lane = 0; lane < 16; ++lane) {
    const int x = x0 + (lane & 3), y = y0 + (lane >> 2);
    const int inside = x < size.x && y < size.y;
    const size_t pixel = inside ? (size_t)y * size.x + x : 0;
    T[lane] = inside ? 1.0f : 0.0f;
    for (int k = 0; k < CHANNELS; ++k)
      d_features[k][lane] = inside ? d_image[pixel * CHANNELS + k] : 0.0f;
#if !COLORS_ONLY
    const float d_a = inside && d_alpha ? d_alpha[pixel] : 0.0f;
    float sum = d_a * alpha[pixel];
    for (int k = 0; k < CHANNELS; ++k)
      sum = fma(d_features[k][lane], image[pixel * CHANNELS + k], sum);
#if WITH_DEPTH
    d_features[CHANNELS][lane] = inside ? d_depth[pixel] : 0.0f;
    sum = fma(d_features[CHANNELS][lane], depth[pixel], sum);
#endif
    d_alphas[lane] = d_a;
    rest[lane] = sum;
#endif
  }
  block->T = vload16(0, T);
#if !COLORS_ONLY
  block->rest = vload16(0, rest);
  block->d_alpha = vload16(0, d_alphas);
#endif
  for (int k = 0; k < FEATURES; ++k) block->d_features[k] = vload16(0, d_features[k]);
  for (int k = FEATURES; k < PADDED; ++k) block->d_features[k] = (float16)(0.0f);
}

__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void raster_backward(
    const int2 size, const int tiles_x, __global const int2 *ranges,
    __global const int *sorted_ids,
    __global const float *records, __global const float *colors, __global const int *used,
    __global const float *image, __global const float *alpha, __global const float *depth,
    __global const float *d_image, __global const float *d_alpha, __global const float *d_depth,
    __global float *partials, __global uchar *touched) {
  const int tile = get_global_id(0);
  const int x0 = (tile % tiles_x) * TILE, y0 = (tile / tiles_x) * TILE;
  const int end = ranges[tile].x + used[tile];
  Chunk chunk;
  Block blocks[BLOCKS];
  for (int b = 0; b < BLOCKS; ++b)
    read_block(&blocks[b], x0 + (b & 3) * 4, y0 + (b >> 2) * 4, size, image, alpha, depth, d_image,
               d_alpha, d_depth);
  float16 weights[BLOCKS];
  float16 px[4], py[4];  // pixel centres of a column and of a row of blocks
  for (int k = 0; k < 4; ++k) {
    px[k] = x0 + 4 * k + 0.5f + LANE_X;
    py[k] = y0 + 4 * k + 0.5f + LANE_Y;
  }
  int open = 0;  // bit b: block b has unfinished pixels
  for (int b = 0; b < BLOCKS; ++b) open |= any_lane(blocks[b].T) << b;
  for (int begin = ranges[tile].x; begin < end; begin += CHUNK) {
    const int count = min(CHUNK, end - begin);
#if COLORS_ONLY
    load_records(&chunk, begin, count, x0, y0, sorted_ids, records);
#else
    load_chunk(&chunk, begin, count, x0, y0, sorted_ids, records, colors);
#endif
    for (int i = 0; i < count; ++i) {
      uint left = chunk.blocks[i] & open;
      if (!left) continue;
      const float8 r = chunk.record[i];
      float16 sums[SUM_VECTORS * 16];
#pragma unroll
      for (int k = 0; k < SUM_VECTORS * 16; ++k) sums[k] = (float16)(0.0f);
      // Moments first, then a few features at a time: more would not fit the registers.
      for (uint rest = left; rest; rest &= rest - 1) {
        const int b = popcount(~rest & (rest - 1));
        weights[b] = blend_backward(&blocks[b], r, chunk.features + i * FEATURES, px[b & 3],
                                    py[b >> 2], sums);
        if (!any_lane(blocks[b].T)) open &= ~(1 << b);
      }
      for (int first = 0; first < PADDED; first += GROUP_SIZE)
        sum_features(blocks, weights, left, first, sums + MOMENTS + first);
      const int row = begin + i;
      touched[row] = 1;
      float total[SUM_VECTORS * 16];
#pragma unroll
      for (int k = 0; k < SUM_VECTORS; ++k) vstore16(sum_lanes(sums + 16 * k), k, total);
#pragma unroll
      for (int k = 0; k < PARTIAL_SIZE / 4; ++k)
        vstore4(vload4(k, total), 0, partials + (size_t)row * PARTIAL_SIZE + 4 * k);
    }
  }
}
