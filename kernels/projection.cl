// EWA projection of 3D Gaussians to the screen, and its derivative (Zwicker et al. 2002; Kerbl et
// al. 2023, eq. 5: cov2d = J W Sigma W^T J^T + eps I).
//
// One work-item per Gaussian. Compile-time: NEAR_M, EPS2D, ANTIALIASED, COMPENSATION_MIN, TILE.
// record = (mean2d x, mean2d y, conic a, conic b, conic c, opacity, depth, unused).
// The determinant is a sum of squares (Cauchy-Binet), so needles cannot make it negative.
#include "common.cl"
#line 9 "projection.cl"

typedef struct {
  float3 t;        // mean in camera axes
  float3 row0, row1;    // rows of J W R S
  float3 jw0, jw1;      // rows of J W
  float3 scale;
  float4 quat;     // normalised
  float quat_norm;
  float tx, ty;    // clamped x, y used by the Jacobian
  int clamp_x, clamp_y;
  float xx, xy, yy;     // cov2d with the low-pass added
  float det_sharp, det;
} Footprint;

float3 quat_row0(float4 q) {
  return (float3)(1 - 2 * (q.z * q.z + q.w * q.w), 2 * (q.y * q.z - q.x * q.w),
                  2 * (q.y * q.w + q.x * q.z));
}
float3 quat_row1(float4 q) {
  return (float3)(2 * (q.y * q.z + q.x * q.w), 1 - 2 * (q.y * q.y + q.w * q.w),
                  2 * (q.z * q.w - q.x * q.y));
}
float3 quat_row2(float4 q) {
  return (float3)(2 * (q.y * q.w - q.x * q.z), 2 * (q.z * q.w + q.x * q.y),
                  1 - 2 * (q.y * q.y + q.z * q.z));
}

// False where the Gaussian cannot be seen or is not a number; nothing divides by z before the test.
int footprint(const float3 mean, const float4 quat_raw, const float3 log_scale, const float16 view,
              const float4 intrinsics, const int2 size, Footprint *f) {
  f->t = (float3)(dot(view.s012, mean) + view.s3, dot(view.s456, mean) + view.s7,
                  dot(view.s89a, mean) + view.sb);
  const float z = f->t.z;
  if (!(z >= NEAR_M) || !isfinite(z)) return 0;
  const float norm2 = dot(quat_raw, quat_raw);
  if (!(norm2 > 1e-24f) || !isfinite(norm2)) return 0;
  f->quat_norm = sqrt(norm2);
  f->quat = quat_raw / f->quat_norm;
  f->scale = exp(log_scale);
  const float iz = 1.0f / z;
  const float fx = intrinsics.x, fy = intrinsics.y, cx = intrinsics.z, cy = intrinsics.w;
  // The Jacobian is clamped 30 % of the half field of view outside the true image borders.
  const float margin_x = 0.15f * size.x / fx, margin_y = 0.15f * size.y / fy;
  const float x_lo = -(cx / fx + margin_x), x_hi = (size.x - cx) / fx + margin_x;
  const float y_lo = -(cy / fy + margin_y), y_hi = (size.y - cy) / fy + margin_y;
  const float x = f->t.x * iz, y = f->t.y * iz;
  f->clamp_x = x < x_lo || x > x_hi;
  f->clamp_y = y < y_lo || y > y_hi;
  f->tx = clamp(x, x_lo, x_hi) * z;
  f->ty = clamp(y, y_lo, y_hi) * z;
  const float3 w0 = view.s012, w1 = view.s456, w2 = view.s89a;
  f->jw0 = fx * iz * (w0 - f->tx * iz * w2);
  f->jw1 = fy * iz * (w1 - f->ty * iz * w2);
  const float3 r0 = quat_row0(f->quat), r1 = quat_row1(f->quat), r2 = quat_row2(f->quat);
  f->row0 = (f->jw0.x * r0 + f->jw0.y * r1 + f->jw0.z * r2) * f->scale;
  f->row1 = (f->jw1.x * r0 + f->jw1.y * r1 + f->jw1.z * r2) * f->scale;
  const float xx = dot(f->row0, f->row0), yy = dot(f->row1, f->row1);
  f->xy = dot(f->row0, f->row1);
  const float3 minors = cross(f->row0, f->row1);
  f->det_sharp = dot(minors, minors);
  f->det = f->det_sharp + EPS2D * (xx + yy) + EPS2D * EPS2D;
  f->xx = xx + EPS2D;
  f->yy = yy + EPS2D;
  return isfinite(f->det);
}

float compensation(const Footprint *f) {
#if ANTIALIASED
  return sqrt(fmax(COMPENSATION_MIN * COMPENSATION_MIN, f->det_sharp / f->det));
#else
  return 1.0f;
#endif
}

__kernel void project_gaussians(const int n, const float16 view, const float4 intrinsics,
                                const int2 size, __global const float *means,
                                __global const float *quats, __global const float *log_scales,
                                __global const float *opacity_logits, __global float *records,
                                __global int4 *tile_rects, __global int *radii) {
  const int i = get_global_id(0);
  if (i >= n) return;
  radii[i] = 0;
  tile_rects[i] = (int4)(0);
  Footprint f;
  if (!footprint(vload3(i, means), vload4(i, quats), vload3(i, log_scales), view, intrinsics, size,
                 &f))
    return;
  const float opacity = compensation(&f) / (1.0f + exp(-opacity_logits[i]));
  if (!(opacity >= ALPHA_MIN)) return;  // before the logarithm below
  const float reach = sqrt(2.0f * log(opacity / ALPHA_MIN));
  const float rx = reach * sqrt(f.xx), ry = reach * sqrt(f.yy);
  const float mx = intrinsics.x * f.t.x / f.t.z + intrinsics.z;
  const float my = intrinsics.y * f.t.y / f.t.z + intrinsics.w;
  if (!isfinite(rx + ry + mx + my)) return;
  // Pixel centres covered: those with |p + 0.5 - m| <= r.
  const float x0 = fmax(mx - rx, 0.0f), x1 = fmin(mx + rx, (float)size.x);
  const float y0 = fmax(my - ry, 0.0f), y1 = fmin(my + ry, (float)size.y);
  if (!(x0 < x1) || !(y0 < y1)) return;
  const int2 tiles = (size + TILE - 1) / TILE;
  tile_rects[i] = (int4)((int)(x0 / TILE), (int)(y0 / TILE), min((int)(x1 / TILE) + 1, tiles.x),
                         min((int)(y1 / TILE) + 1, tiles.y));
  radii[i] = (int)fmin(ceil(fmax(rx, ry)), 1e9f);
  vstore8((float8)(mx, my, f.yy / f.det, -f.xy / f.det, f.xx / f.det, opacity, f.t.z, 0.0f), i,
          records);
}

// d_record has the order of SLOT_*: mean2d x y, conic a b c, opacity, depth.
__kernel void project_gaussians_backward(
    const int n, const float16 view, const float4 intrinsics, const int2 size,
    __global const float *means, __global const float *quats, __global const float *log_scales,
    __global const float *opacity_logits, __global const int *radii, __global const float *d_records,
    __global float *d_means, __global float *d_quats, __global float *d_log_scales,
    __global float *d_opacity_logits, __global float *mean2d_norm) {
  const int i = get_global_id(0);
  if (i >= n) return;
  Footprint f;
  if (radii[i] <= 0 || !footprint(vload3(i, means), vload4(i, quats), vload3(i, log_scales), view,
                                  intrinsics, size, &f)) {
    vstore3((float3)(0), i, d_means);
    vstore4((float4)(0), i, d_quats);
    vstore3((float3)(0), i, d_log_scales);
    d_opacity_logits[i] = 0;
    mean2d_norm[i] = 0;
    return;
  }
  const float8 d = vload8(i, d_records);
  const float fx = intrinsics.x, fy = intrinsics.y;
  mean2d_norm[i] = hypot(d.s0 * 0.5f * size.x, d.s1 * 0.5f * size.y);
  const float sigmoid = 1.0f / (1.0f + exp(-opacity_logits[i]));
  const float comp = compensation(&f);
  d_opacity_logits[i] = d.s5 * comp * sigmoid * (1.0f - sigmoid);

  // conic = cov2d^-1, so d_cov = -conic V conic with V = [[va, vb/2], [vb/2, vc]].
  const float a = f.yy / f.det, b = -f.xy / f.det, c = f.xx / f.det;
  const float va = d.s2, vb = 0.5f * d.s3, vc = d.s4;
  const float p00 = a * va + b * vb, p01 = a * vb + b * vc;
  const float p10 = b * va + c * vb, p11 = b * vb + c * vc;
  float gxx = -(p00 * a + p01 * b), gxy = -(p00 * b + p01 * c), gyy = -(p10 * b + p11 * c);
#if ANTIALIASED
  const float ratio = f.det_sharp / f.det;
  if (ratio > COMPENSATION_MIN * COMPENSATION_MIN) {
    // d sqrt(det_sharp / det) / d cov = comp / 2 (cov_sharp^-1 - cov^-1)
    const float k = 0.5f * comp * sigmoid * d.s5, is = 1.0f / f.det_sharp;
    gxx += k * ((f.yy - EPS2D) * is - a);
    gxy += k * (-f.xy * is - b);
    gyy += k * ((f.xx - EPS2D) * is - c);
  }
#endif
  const float3 d_row0 = 2.0f * (gxx * f.row0 + gxy * f.row1);
  const float3 d_row1 = 2.0f * (gxy * f.row0 + gyy * f.row1);

  // rows = (J W) (R S)
  const float3 r0 = quat_row0(f.quat), r1 = quat_row1(f.quat), r2 = quat_row2(f.quat);
  const float3 e0 = d_row0 * f.scale, e1 = d_row1 * f.scale;
  const float3 d_jw0 = (float3)(dot(e0, r0), dot(e0, r1), dot(e0, r2));
  const float3 d_jw1 = (float3)(dot(e1, r0), dot(e1, r1), dot(e1, r2));
  // d (R S), rows of the 3x3
  const float3 m0 = f.jw0.x * d_row0 + f.jw1.x * d_row1;
  const float3 m1 = f.jw0.y * d_row0 + f.jw1.y * d_row1;
  const float3 m2 = f.jw0.z * d_row0 + f.jw1.z * d_row1;
  vstore3((m0 * r0 + m1 * r1 + m2 * r2) * f.scale, i, d_log_scales);
  const float3 g0 = m0 * f.scale, g1 = m1 * f.scale, g2 = m2 * f.scale;
  const float w = f.quat.x, x = f.quat.y, y = f.quat.z, zq = f.quat.w;
  float4 dq;
  dq.x = 2 * (x * (g2.y - g1.z) + y * (g0.z - g2.x) + zq * (g1.x - g0.y));
  dq.y = 2 * (-2 * x * (g1.y + g2.z) + y * (g0.y + g1.x) + zq * (g0.z + g2.x) + w * (g2.y - g1.z));
  dq.z = 2 * (x * (g0.y + g1.x) - 2 * y * (g0.x + g2.z) + zq * (g1.z + g2.y) + w * (g0.z - g2.x));
  dq.w = 2 * (x * (g0.z + g2.x) + y * (g1.z + g2.y) - 2 * zq * (g0.x + g1.y) + w * (g1.x - g0.y));
  // through the normalisation
  vstore4((dq - f.quat * dot(dq, f.quat)) / f.quat_norm, i, d_quats);

  // J: j00 = fx / z, j02 = -fx tx / z^2, and the same for y.
  const float3 w0 = view.s012, w1 = view.s456, w2 = view.s89a;
  const float iz = 1.0f / f.t.z;
  const float d_j00 = dot(d_jw0, w0), d_j02 = dot(d_jw0, w2);
  const float d_j11 = dot(d_jw1, w1), d_j12 = dot(d_jw1, w2);
  float3 dt;
  dt.x = d.s0 * fx * iz;
  dt.y = d.s1 * fy * iz;
  dt.z = -(d.s0 * fx * f.t.x + d.s1 * fy * f.t.y) * iz * iz + d.s6;
  dt.z -= (fx * d_j00 + fy * d_j11) * iz * iz;
  // A clamped tx is limit * z, so j02 falls with 1/z instead of 1/z^2 and does not see x.
  const float kx = fx * iz * iz * d_j02, ky = fy * iz * iz * d_j12;
  if (f.clamp_x) dt.z += kx * f.tx * iz; else { dt.x -= kx; dt.z += 2 * kx * f.tx * iz; }
  if (f.clamp_y) dt.z += ky * f.ty * iz; else { dt.y -= ky; dt.z += 2 * ky * f.ty * iz; }
  vstore3(dt.x * w0 + dt.y * w1 + dt.z * w2, i, d_means);
}
