// The photometric loss of loss_image.cl in one kernel, for CPUs: nothing but the images, the
// gradient and the sums passes through memory.
//
// For 8 channels or more. One work-item takes a strip of STRIP columns, 8 channels at a time, and
// goes down the image ROWS rows at a time; its planes are rings of rows in a scratch that fits the
// second-level cache. With u = x + y and v = x - y the loss needs E[u], E[u²], E[v], E[v²] alone:
//   2 E[x] E[y] = (E[u]² - E[v]²) / 2,  E[x]² + E[y]² = (E[u]² + E[v]²) / 2,
// and the same for (co)variances. Clamping var u and var v at zero keeps SSIM within [-1, 1]; what
// was clamped has no derivative.
// A window is symmetric: pairs of taps are added first, as adders run beside the multipliers.
// Torch twin: luxcore/splats/losses/twin.py::image_loss.
// Compile-time: HEIGHT, WIDTH, CHANNELS (>= 8), STRIP (a multiple of 4), SCRATCH (floats of a
// work-item).
#line 15 "loss_image_strips.cl"

#define RADIUS 5
#define C1 1e-4f
#define C2 9e-4f
#define ROWS 4
#define TAPS (ROWS + 2 * RADIUS)  // rows (or pixels) that ROWS outputs see
#define RING 5                    // blocks of ROWS rows of which a vertical window sees TAPS

#define LANES 8     // floats of a pixel in the scratch: neighbours are whole vectors apart
#define TOGETHER 4  // pixels blurred at once along a row
#define GROUPS ((CHANNELS + 7) / 8)
#define ROW (WIDTH * CHANNELS)
// Widths in floats, whole steps of TOGETHER vectors: of what is blurred down (moments), of where
// SSIM is needed, and of the strip itself.
#define STEP (8 * TOGETHER)
#define WHOLE(floats) (((floats) + STEP - 1) / STEP * STEP)
#define INNER (STRIP * LANES)
#define MIDDLE WHOLE((STRIP + 2 * RADIUS) * LANES)
#define OUTER (MIDDLE + WHOLE(2 * RADIUS * LANES))
#define IMAGES (RING * ROWS * 2 * OUTER)        // ring of u and v, of one group
#define DERIVATIVES (RING * ROWS * 3 * MIDDLE)  // ring of derivatives

#define W0 0.26601173f
#define W1 0.21300554f
#define W2 0.10936069f
#define W3 0.03600077f
#define W4 0.00759876f
#define W5 0.00102838f

// The window about in[RADIUS].
inline float8 window(const float8 *in) {
  float8 sum = W0 * in[5];
  sum = fma(in[4] + in[6], W1, sum);
  sum = fma(in[3] + in[7], W2, sum);
  sum = fma(in[2] + in[8], W3, sum);
  sum = fma(in[1] + in[9], W4, sum);
  return fma(in[0] + in[10], W5, sum);
}

typedef struct {
  int first;    // column of the strip's first pixel
  int channel;  // first channel of the group
  int fresh;    // lanes below it belong to the group before
} Part;

// Where the vector at float i of a scratch row lies in a row of the image, `before` pixels left of
// the strip; -1 outside the image.
inline int image_index(const Part part, const int before, const int i) {
  const int pixel = part.first - before + i / LANES;
  return pixel >= 0 && pixel < WIDTH ? pixel * CHANNELS + part.channel : -1;
}

// Rows `row` to row + ROWS - 1 of u and v into their ring: [ROWS, 2, OUTER], zero outside the image.
void load_rows(const Part part, const int row, __global const float *x, __global const float *y,
               __global float *block) {
  for (int r = 0; r < ROWS; ++r) {
    __global float *u = block + 2 * r * OUTER, *v = u + OUTER;
    const size_t line = (size_t)(row + r) * ROW;
    for (int i = 0; i < OUTER; i += 8) {
      const int index = row + r < HEIGHT ? image_index(part, 2 * RADIUS, i) : -1;
      float8 a = (float8)(0.0f), b = (float8)(0.0f);
      if (index >= 0) {
        a = vload8(0, x + line + index);
        b = vload8(0, y + line + index);
      }
      vstore8(a + b, 0, u + i);
      vstore8(a - b, 0, v + i);
    }
  }
}

// Vertical windows of in and in² for ROWS rows: rows of `in` are at `offset`, those of both windows
// OUTER floats apart.
inline void blur_down(__global const float *in, const int *offset, __global float *mean,
                      __global float *square) {
  float8 rows[TAPS];
#pragma unroll
  for (int k = 0; k < TAPS; ++k) rows[k] = vload8(0, in + offset[k]);
#pragma unroll
  for (int r = 0; r < ROWS; ++r) vstore8(window(rows + r), 0, mean + r * OUTER);
#pragma unroll
  for (int k = 0; k < TAPS; ++k) rows[k] *= rows[k];
#pragma unroll
  for (int r = 0; r < ROWS; ++r) vstore8(window(rows + r), 0, square + r * OUTER);
}

// Where the TAPS rows lie that ROWS outputs see: the first output is row `row` of a ring of
// `blocks` blocks whose rows are `stride` floats long.
inline void ring_offsets(const int row, const int blocks, const int stride, int *offset) {
  for (int k = 0; k < TAPS; ++k)
    offset[k] = (row - RADIUS + k + blocks * ROWS) % (blocks * ROWS) * stride;
}

// Vertical windows of u, u², v, v² for ROWS rows from `row`: moments [4, ROWS, OUTER].
void blur_moments(const int row, __global const float *images, __global float *moments) {
  int offset[TAPS];
  ring_offsets(row, RING, 2 * OUTER, offset);
  for (int i = 0; i < OUTER; i += 8)
    for (int image = 0; image < 2; ++image) {
      __global float *out = moments + 2 * image * ROWS * OUTER + i;
      blur_down(images + image * OUTER + i, offset, out, out + ROWS * OUTER);
    }
}

// Horizontal windows of TOGETHER vectors from float i of a scratch row, LANES floats apart.
inline void blur_row(__global const float *row, const int i, float8 *out) {
  float8 in[TOGETHER + 2 * RADIUS];
#pragma unroll
  for (int k = 0; k < TOGETHER + 2 * RADIUS; ++k) in[k] = vload8(0, row + i + k * LANES);
#pragma unroll
  for (int t = 0; t < TOGETHER; ++t) out[t] = window(in + t);
}

// SSIM, and its derivatives: by the image through the means, and twice those by E[u²] and E[v²].
inline float8 ssim(const float8 mu, const float8 muu, const float8 mv, const float8 mvv,
                   float8 *d_mean, float8 *d_uu, float8 *d_vv) {
  const float8 uu = mu * mu, vv = mv * mv;
  const float8 raw_u = muu - uu, raw_v = mvv - vv;
  const float8 su = max(raw_u, 0.0f), sv = max(raw_v, 0.0f);
  const float8 a1 = fma(uu - vv, 0.5f, (float8)(C1)), b1 = fma(uu + vv, 0.5f, (float8)(C1));
  const float8 a2 = fma(su - sv, 0.5f, (float8)(C2)), b2 = fma(su + sv, 0.5f, (float8)(C2));
  const float8 inverse = 1.0f / (b1 * b2);
  const float8 value = a1 * a2 * inverse;
  const float8 by_a1 = a2 * inverse, by_b1 = -value * (inverse * b2);
  const float8 by_a2 = a1 * inverse, by_b2 = -value * (inverse * b1);
  const float8 du = raw_u > 0.0f ? by_a2 + by_b2 : (float8)(0.0f);
  const float8 dv = raw_v > 0.0f ? by_b2 - by_a2 : (float8)(0.0f);
  *d_mean = mu * (by_a1 + by_b1 - du) + mv * (by_b1 - by_a1 - dv);
  *d_uu = du;
  *d_vv = dv;
  return value;
}

inline float sum8(const float8 v) {
  const float4 a = v.lo + v.hi;
  const float2 b = a.lo + a.hi;
  return b.x + b.y;
}

// The lanes of a value that belong to this group alone.
inline float8 fresh(const Part part, const float8 value) {
  return (int8)(0, 1, 2, 3, 4, 5, 6, 7) >= part.fresh ? value : (float8)(0.0f);
}

// Rows of derivatives [3, MIDDLE] from moments; zero outside the image. Returns the sum of SSIM.
float ssim_rows(const Part part, const int row, __global const float *moments,
                __global float *block) {
  float8 sum = (float8)(0.0f);
  for (int r = 0; r < ROWS; ++r) {
    __global float *out = block + r * 3 * MIDDLE;
    for (int i = 0; i < MIDDLE; i += STEP) {
      float8 m[4][TOGETHER];
#pragma unroll
      for (int plane = 0; plane < 4; ++plane)
        blur_row(moments + (plane * ROWS + r) * OUTER, i, m[plane]);
#pragma unroll
      for (int t = 0; t < TOGETHER; ++t) {
        float8 d_mean, d_uu, d_vv;
        const float8 value = ssim(m[0][t], m[1][t], m[2][t], m[3][t], &d_mean, &d_uu, &d_vv);
        const int at = i + 8 * t;
        const int inside = image_index(part, RADIUS, at) >= 0 && row + r < HEIGHT;
        const int of_strip = at >= RADIUS * LANES && at < RADIUS * LANES + INNER;
        if (inside && of_strip) sum += fresh(part, value);
        vstore8(inside ? d_mean : (float8)(0.0f), 0, out + at);
        vstore8(inside ? d_uu : (float8)(0.0f), 0, out + MIDDLE + at);
        vstore8(inside ? d_vv : (float8)(0.0f), 0, out + 2 * MIDDLE + at);
      }
    }
  }
  return sum8(sum);
}

// Vertical windows of the derivatives for ROWS rows from `row`: down [ROWS, 3, MIDDLE].
void blur_derivatives(const int row, __global const float *ring, __global float *down) {
  int offset[TAPS];
  ring_offsets(row, RING, 3 * MIDDLE, offset);
  for (int i = 0; i < 3 * MIDDLE; i += 8) {
    float8 in[TAPS];
#pragma unroll
    for (int k = 0; k < TAPS; ++k) in[k] = vload8(0, ring + offset[k] + i);
#pragma unroll
    for (int r = 0; r < ROWS; ++r) vstore8(window(in + r), 0, down + r * 3 * MIDDLE + i);
  }
}

// d_x = ssim_scale · dSSIM/dx + l1_scale · sign(x - y). Returns the sum of |x - y|.
float write_gradient(const Part part, const int row, __global const float *down,
                     __global const float *images, const float l1_scale, const float ssim_scale,
                     __global float *d_x) {
  float8 sum = (float8)(0.0f);
  for (int r = 0; r < ROWS && row + r < HEIGHT; ++r) {
    __global const float *in = down + r * 3 * MIDDLE;
    __global const float *u = images + (row + r) % (RING * ROWS) * 2 * OUTER;
    const size_t line = (size_t)(row + r) * ROW;
    for (int i = 0; i < INNER; i += STEP) {
      float8 d[3][TOGETHER];
#pragma unroll
      for (int plane = 0; plane < 3; ++plane) blur_row(in + plane * MIDDLE, i, d[plane]);
#pragma unroll
      for (int t = 0; t < TOGETHER; ++t) {
        const int index = image_index(part, 0, i + 8 * t);
        if (index < 0) continue;
        const int at = i + 8 * t + 2 * RADIUS * LANES;
        const float8 v = vload8(0, u + OUTER + at);
        const float8 by_ssim = d[0][t] + vload8(0, u + at) * d[1][t] + v * d[2][t];
        const float8 g = ssim_scale * by_ssim + l1_scale * sign(v);
        sum += fresh(part, fabs(v));
        if (part.fresh == 0) {
          vstore8(g, 0, d_x + line + index);
        } else {
          for (int k = part.fresh; k < 8; ++k) d_x[line + index + k] = ((const float *)&g)[k];
        }
      }
    }
  }
  return sum8(sum);
}

// One step of a group of channels. Step j reads block j of rows, knows the derivatives of block
// j - 2 and writes the gradient of block j - 4. Adds the sums of |x - y| and of SSIM.
void step(const Part part, const int j, __global const float *x, __global const float *y,
          const float l1_scale, const float ssim_scale, __global float *images,
          __global float *ring, __global float *moments, __global float *down,
          __global float *d_x, float *sums) {
  load_rows(part, j * ROWS, x, y, images + (j % RING) * ROWS * 2 * OUTER);
  if (j < 2) return;
  blur_moments((j - 2) * ROWS, images, moments);
  sums[1] += ssim_rows(part, (j - 2) * ROWS, moments,
                       ring + ((j - 2) % RING) * ROWS * 3 * MIDDLE);
  if (j < 4) return;
  blur_derivatives((j - 4) * ROWS, ring, down);
  sums[0] += write_gradient(part, (j - 4) * ROWS, down, images, l1_scale, ssim_scale, d_x);
}

// sums [strips, 2]: of |x - y| and of SSIM. All groups of a strip advance together, so that each
// line of the images is read and written once.
__kernel __attribute__((reqd_work_group_size(1, 1, 1))) void image_loss(
    __global const float *x, __global const float *y, const float l1_scale,
    const float ssim_scale, __global float *scratch, __global float *d_x, __global float *sums) {
  const int id = get_global_id(0);
  __global float *images = scratch + (size_t)id * SCRATCH;
  __global float *ring = images + GROUPS * IMAGES;
  __global float *moments = ring + GROUPS * DERIVATIVES;
  __global float *down = moments + 4 * ROWS * OUTER;
  for (int i = 0; i < GROUPS * (IMAGES + DERIVATIVES); i += 8)
    vstore8((float8)(0.0f), 0, images + i);
  float total[2] = {0.0f, 0.0f};
  for (int j = 0; (j - 4) * ROWS < HEIGHT; ++j)
    for (int group = 0; group < GROUPS; ++group) {
      const int channel = min(8 * group, CHANNELS - 8);
      const Part part = {id * STRIP, channel, 8 * group - channel};
      step(part, j, x, y, l1_scale, ssim_scale, images + group * IMAGES,
           ring + group * DERIVATIVES, moments, down, d_x, total);
    }
  sums[2 * id] = total[0];
  sums[2 * id + 1] = total[1];
}
