// Photometric loss and its gradient: l1_weight · |x - y| + ssim_weight · (1 - SSIM), mean over
// pixels, any number of channels (supplement, L_olat; SSIM of Wang et al. 2004, 11x11 Gaussian
// window, sigma 1.5, zero outside the image, as in the 3DGS reference).
//
// Images are [H, W·C] rows; one work-item handles 16 consecutive values of a row. The window is
// separable: blur_columns, then a row pass. Row passes read padded rows (PAD zeros on both sides,
// written never), so that taps at distance k·C need no test. Moments are E[x], E[x²], E[y], E[y²],
// E[xy]. Torch twin: luxcore/splats/losses/twin.py::image_loss.
// Compile-time: HEIGHT, ROW (= W·C), CHANNELS, PAD (>= 5·C), STRIDE (padded row),
// BLOCKS (work-items per row).
#line 14 "loss_image.cl"

#define RADIUS 5
#define C1 1e-4f
#define C2 9e-4f

__constant float WINDOW[2 * RADIUS + 1] = {
    0.00102838f, 0.00759876f, 0.03600077f, 0.10936069f, 0.21300554f, 0.26601173f,
    0.21300554f, 0.10936069f, 0.03600077f, 0.00759876f, 0.00102838f};

float16 load_row(__global const float *row, int i) {
  if (i + 16 <= ROW) return vload16(0, row + i);
  float16 v = 0.0f;
  for (int k = 0; k < ROW - i; ++k) ((float *)&v)[k] = row[i + k];
  return v;
}

void store_row(float16 v, __global float *row, int i) {
  if (i + 16 <= ROW) {
    vstore16(v, 0, row + i);
  } else {
    for (int k = 0; k < ROW - i; ++k) row[i + k] = ((float *)&v)[k];
  }
}

float sum16(float16 v) {
  const float8 a = v.lo + v.hi;
  const float4 b = a.lo + a.hi;
  const float2 c = b.lo + b.hi;
  return c.x + c.y;
}

float16 blur_row(__global const float *padded_row, int i) {
  float16 sum = 0.0f;
#pragma unroll
  for (int k = -RADIUS; k <= RADIUS; ++k)
    sum += WINDOW[k + RADIUS] * vload16(0, padded_row + PAD + i + k * CHANNELS);
  return sum;
}

// Vertical blur of x, x², y, y², xy into `moments` [5, H, STRIDE].
__kernel void moments_columns(__global const float *x, __global const float *y,
                              __global float *moments) {
  const int i = (get_global_id(0) % BLOCKS) * 16, row = get_global_id(0) / BLOCKS;
  float16 m0 = 0.0f, m1 = 0.0f, m2 = 0.0f, m3 = 0.0f, m4 = 0.0f;
  for (int k = max(-RADIUS, -row); k <= min(RADIUS, HEIGHT - 1 - row); ++k) {
    const float w = WINDOW[k + RADIUS];
    const float16 a = load_row(x + (size_t)(row + k) * ROW, i);
    const float16 b = load_row(y + (size_t)(row + k) * ROW, i);
    m0 += w * a;
    m1 += w * a * a;
    m2 += w * b;
    m3 += w * b * b;
    m4 += w * a * b;
  }
  const size_t plane = (size_t)HEIGHT * STRIDE;
  __global float *out = moments + (size_t)row * STRIDE + PAD;
  store_row(m0, out, i);
  store_row(m1, out + plane, i);
  store_row(m2, out + 2 * plane, i);
  store_row(m3, out + 3 * plane, i);
  store_row(m4, out + 4 * plane, i);
}

// Horizontal blur of the moments, SSIM, and its derivatives with respect to E[x], E[x²], E[xy]:
// `partials` [3, H, ROW]; sum of SSIM per work-item: `sums` [H, BLOCKS].
__kernel void ssim_rows(__global const float *moments, __global float *partials,
                        __global float *sums) {
  const int i = (get_global_id(0) % BLOCKS) * 16, row = get_global_id(0) / BLOCKS;
  const size_t plane = (size_t)HEIGHT * STRIDE;
  __global const float *in = moments + (size_t)row * STRIDE;
  const float16 mx = blur_row(in, i), my = blur_row(in + 2 * plane, i);
  const float16 raw_xx = blur_row(in + plane, i) - mx * mx;
  const float16 raw_yy = blur_row(in + 3 * plane, i) - my * my;
  // Rounding makes variances of flat regions slightly negative, and covariances larger than
  // Cauchy-Schwarz allows: SSIM would exceed one there and its derivative would be noise. What was
  // clamped has no derivative, beyond the rounding of a perfect correlation.
  const float16 vx = fmax(raw_xx, 0.0f), vy = fmax(raw_yy, 0.0f);
  const float16 bound = sqrt(vx * vy);
  const float16 raw_xy = blur_row(in + 4 * plane, i) - mx * my;
  const float16 cxy = clamp(raw_xy, -bound, bound);
  const float16 a1 = 2.0f * mx * my + C1, a2 = 2.0f * cxy + C2;
  const float16 b1 = mx * mx + my * my + C1, b2 = vx + vy + C2;
  const float16 ssim = (a1 * a2) / (b1 * b2);
  float16 d_vx = -ssim / b2;
  float16 d_cxy = 2.0f * a1 / (b1 * b2);
  d_vx = select(d_vx, (float16)0.0f, raw_xx <= 0.0f);
  d_cxy = select(d_cxy, (float16)0.0f, fabs(raw_xy) > 1.001f * bound);
  const float16 d_mx = 2.0f * my * a2 / (b1 * b2) - 2.0f * mx * ssim / b1;
  const size_t size = (size_t)HEIGHT * ROW;
  __global float *out = partials + (size_t)row * ROW;
  // Variance and covariance are E[x²] - E[x]² and E[xy] - E[x]E[y].
  store_row(d_mx - 2.0f * mx * d_vx - my * d_cxy, out, i);
  store_row(d_vx, out + size, i);
  store_row(d_cxy, out + 2 * size, i);
  float16 inside = ssim;
  for (int k = max(ROW - i, 0); k < 16; ++k) ((float *)&inside)[k] = 0.0f;
  sums[get_global_id(0)] = sum16(inside);
}

// Vertical blur of the three partials into padded planes [3, H, STRIDE].
__kernel void partials_columns(__global const float *partials, __global float *padded) {
  const int i = (get_global_id(0) % BLOCKS) * 16, row = get_global_id(0) / BLOCKS;
  const size_t size = (size_t)HEIGHT * ROW;
  float16 p0 = 0.0f, p1 = 0.0f, p2 = 0.0f;
  for (int k = max(-RADIUS, -row); k <= min(RADIUS, HEIGHT - 1 - row); ++k) {
    const float w = WINDOW[k + RADIUS];
    __global const float *in = partials + (size_t)(row + k) * ROW;
    p0 += w * load_row(in, i);
    p1 += w * load_row(in + size, i);
    p2 += w * load_row(in + 2 * size, i);
  }
  const size_t plane = (size_t)HEIGHT * STRIDE;
  __global float *out = padded + (size_t)row * STRIDE + PAD;
  store_row(p0, out, i);
  store_row(p1, out + plane, i);
  store_row(p2, out + 2 * plane, i);
}

// d_x [H, ROW] = ssim_scale · dSSIM/dx + l1_scale · sign(x - y); sums of |x - y| per work-item.
__kernel void gradient_rows(__global const float *x, __global const float *y,
                            __global const float *padded, const float l1_scale,
                            const float ssim_scale, __global float *d_x, __global float *sums) {
  const int i = (get_global_id(0) % BLOCKS) * 16, row = get_global_id(0) / BLOCKS;
  const size_t plane = (size_t)HEIGHT * STRIDE;
  __global const float *in = padded + (size_t)row * STRIDE;
  const float16 a = load_row(x + (size_t)row * ROW, i);
  const float16 b = load_row(y + (size_t)row * ROW, i);
  const float16 ssim = blur_row(in, i) + 2.0f * a * blur_row(in + plane, i) +
                       b * blur_row(in + 2 * plane, i);
  store_row(ssim_scale * ssim + l1_scale * sign(a - b), d_x + (size_t)row * ROW, i);
  sums[get_global_id(0)] = sum16(fabs(a - b));
}

// L1 alone, for runs that ask for no D-SSIM: the same outputs as gradient_rows.
__kernel void gradient_l1(__global const float *x, __global const float *y, const float l1_scale,
                          __global float *d_x, __global float *sums) {
  const int i = (get_global_id(0) % BLOCKS) * 16, row = get_global_id(0) / BLOCKS;
  const float16 a = load_row(x + (size_t)row * ROW, i);
  const float16 b = load_row(y + (size_t)row * ROW, i);
  store_row(l1_scale * sign(a - b), d_x + (size_t)row * ROW, i);
  sums[get_global_id(0)] = sum16(fabs(a - b));
}
