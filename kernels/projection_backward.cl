// Derivative of the projection (see footprint.cl): from what blending left per Gaussian to means,
// quaternions, log-scales and opacity logits. One work-item per Gaussian, n of them.
//
// moments [n, 8]: with h = dL/d ln(alpha) of a pixel and d = mean2d - pixel, the sums over pixels of
// h, h dx, h dy, h dx^2, h dx dy, h dy^2, then dL/d depth.
// mean2d_norm is the length of dL/d mean2d in units of half the image size.
#include "footprint.cl"
#line 9 "projection_backward.cl"

__kernel void project_gaussians_backward(
    const int n, const float16 view, const float4 intrinsics, const int2 size,
    __global const float *means, __global const float *quats, __global const float *log_scales,
    __global const float *opacity_logits, __global const int *radii,
    __global const float *moments,
    __global float *d_means, __global float *d_quats, __global float *d_log_scales,
    __global float *d_opacity_logits, __global float *mean2d_norm,
    __global uchar *visible) {
  const int i = get_global_id(0);
  if (i >= n) return;
  Footprint f;
  visible[i] = radii[i] > 0;
  if (radii[i] <= 0 || !footprint(vload3(i, means), vload4(i, quats), vload3(i, log_scales), view,
                                  intrinsics, size, &f)) {
    vstore3((float3)(0), i, d_means);
    vstore4((float4)(0), i, d_quats);
    vstore3((float3)(0), i, d_log_scales);
    d_opacity_logits[i] = 0;
    mean2d_norm[i] = 0;
    return;
  }
  const float8 h = vload8(i, moments);
  const float fx = intrinsics.x, fy = intrinsics.y;
  // ln alpha = ln opacity - (a dx^2 + c dy^2) / 2 - b dx dy
  const float a = f.yy / f.det, b = -f.xy / f.det, c = f.xx / f.det;
  const float2 d_mean2d = -(float2)(a * h.s1 + b * h.s2, b * h.s1 + c * h.s2);
  mean2d_norm[i] = hypot(d_mean2d.x * 0.5f * size.x, d_mean2d.y * 0.5f * size.y);
  d_opacity_logits[i] = h.s0 / (1.0f + exp(opacity_logits[i]));

  // conic = cov2d^-1, so d_cov = -conic V conic with V symmetric.
  const float va = -0.5f * h.s3, vb = -0.5f * h.s4, vc = -0.5f * h.s5;
  const float p00 = a * va + b * vb, p01 = a * vb + b * vc;
  const float p10 = b * va + c * vb, p11 = b * vb + c * vc;
  float gxx = -(p00 * a + p01 * b), gxy = -(p00 * b + p01 * c), gyy = -(p10 * b + p11 * c);
#if ANTIALIASED
  const float ratio = f.det_sharp / f.det;
  if (ratio > COMPENSATION_MIN * COMPENSATION_MIN) {
    // d ln sqrt(det_sharp / det) / d cov = 1/2 (cov_sharp^-1 - cov^-1)
    const float k = 0.5f * h.s0, is = 1.0f / f.det_sharp;
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
  dt.x = d_mean2d.x * fx * iz;
  dt.y = d_mean2d.y * fy * iz;
  dt.z = -(d_mean2d.x * fx * f.t.x + d_mean2d.y * fy * f.t.y) * iz * iz + h.s6;
  dt.z -= (fx * d_j00 + fy * d_j11) * iz * iz;
  // A clamped tx is limit * z, so j02 falls with 1/z instead of 1/z^2 and does not see x.
  const float kx = fx * iz * iz * d_j02, ky = fy * iz * iz * d_j12;
  if (f.clamp_x) dt.z += kx * f.tx * iz; else { dt.x -= kx; dt.z += 2 * kx * f.tx * iz; }
  if (f.clamp_y) dt.z += ky * f.ty * iz; else { dt.y -= ky; dt.z += 2 * ky * f.ty * iz; }
  vstore3(dt.x * w0 + dt.y * w1 + dt.z * w2, i, d_means);
}
