// Derivative of the projection (see footprint.cl): from what blending left per Gaussian to means,
// quaternions, log-scales and opacity logits. LANES Gaussians per work-item, n in all.
//
// moments [n, 8]: with h = dL/d ln(alpha) of a pixel and d = mean2d - pixel, the sums over pixels of
// h, h dx, h dy, h dx^2, h dx dy, h dy^2, then dL/d depth.
// mean2d_norm is the length of dL/d mean2d in units of half the image size.
#include "footprint.cl"
#line 9 "projection_backward.cl"

typedef struct {
  F x, y;        // dL/d mean2d
  F xx, xy, yy;  // dL/d cov2d, symmetric: xy is one of two equal entries
} ScreenGradient;

// ln alpha = ln opacity - (a dx^2 + c dy^2) / 2 - b dx dy with the conic [[a, b], [b, c]] = cov2d^-1,
// so d_cov = -conic V conic, V = -1/2 [[h dx^2, h dx dy], [h dx dy, h dy^2]].
ScreenGradient screen_gradient(const Footprint *f, __global const float *moments, const int first,
                               const int n) {
  const F inverse = 1.0f / f->det;
  const F a = f->yy * inverse, b = -f->xy * inverse, c = f->xx * inverse;
  const F hx = load_field(moments, first, n, 8, 1), hy = load_field(moments, first, n, 8, 2);
  const F va = 0.5f * load_field(moments, first, n, 8, 3);
  const F vb = 0.5f * load_field(moments, first, n, 8, 4);
  const F vc = 0.5f * load_field(moments, first, n, 8, 5);
  const F p00 = a * va + b * vb, p01 = a * vb + b * vc;
  const F p10 = b * va + c * vb, p11 = b * vb + c * vc;
  ScreenGradient g = {-(a * hx + b * hy), -(b * hx + c * hy), p00 * a + p01 * b,
                      p00 * b + p01 * c, p10 * b + p11 * c};
#if ANTIALIASED
  // d ln sqrt(det_sharp / det) / d cov = (cov_sharp^-1 - cov^-1) / 2, nothing at the floor.
  const I above = f->det_sharp > COMPENSATION_MIN * COMPENSATION_MIN * f->det;
  const F k = above ? 0.5f * load_field(moments, first, n, 8, 0) : (F)0.0f;
  const F sharp = 1.0f / (above ? f->det_sharp : (F)1.0f);
  g.xx += k * ((f->yy - EPS2D) * sharp - a);
  g.xy += k * (-f->xy * sharp - b);
  g.yy += k * ((f->xx - EPS2D) * sharp - c);
#endif
  return g;
}

// Through R(q / |q|): g0, g1, g2 are the rows of dL/dR.
void quaternion_gradient(const Footprint *f, const V3 g0, const V3 g1, const V3 g2, F *d_quat) {
  const F w = f->w, x = f->x, y = f->y, z = f->z;
  const F yz = g2.y - g1.z, zx = g0.z - g2.x, xy = g1.x - g0.y;
  const F sx = g1.z + g2.y, sy = g0.z + g2.x, sz = g0.y + g1.x;
  const F dw = 2.0f * (x * yz + y * zx + z * xy);
  const F dx = 2.0f * (w * yz - 2.0f * x * (g1.y + g2.z) + y * sz + z * sy);
  const F dy = 2.0f * (w * zx + x * sz - 2.0f * y * (g0.x + g2.z) + z * sx);
  const F dz = 2.0f * (w * xy + x * sy + y * sx - 2.0f * z * (g0.x + g1.y));
  const F along = dw * w + dx * x + dy * y + dz * z, inverse = 1.0f / f->quat_norm;
  d_quat[0] = (dw - along * w) * inverse;
  d_quat[1] = (dx - along * x) * inverse;
  d_quat[2] = (dy - along * y) * inverse;
  d_quat[3] = (dz - along * z) * inverse;
}

// dL/dt of the mean in camera axes: through mean2d, the Jacobian and the depth.
V3 camera_gradient(const Footprint *f, const ScreenGradient *g, const V3 d_jw0, const V3 d_jw1,
                   const F d_depth, const float16 view, const float4 intrinsics) {
  const V3 w0 = {(F)view.s0, (F)view.s1, (F)view.s2}, w1 = {(F)view.s4, (F)view.s5, (F)view.s6};
  const V3 w2 = {(F)view.s8, (F)view.s9, (F)view.sa};
  const F iz = 1.0f / f->t.z, jx = intrinsics.x * iz, jy = intrinsics.y * iz;
  // j02 = -fx tx / z^2. A clamped tx is limit * z, so it falls with 1/z and does not see x.
  const F kx = jx * iz * dot3(d_jw0, w2), ky = jy * iz * dot3(d_jw1, w2);
  V3 t = {g->x * jx - (f->clamped_x ? (F)0.0f : kx), g->y * jy - (f->clamped_y ? (F)0.0f : ky),
          d_depth};
  t.z -= (g->x * jx * f->t.x + g->y * jy * f->t.y) * iz;
  t.z -= (jx * dot3(d_jw0, w0) + jy * dot3(d_jw1, w1)) * iz;
  t.z += kx * f->tx * iz * (f->clamped_x ? (F)1.0f : (F)2.0f);
  t.z += ky * f->ty * iz * (f->clamped_y ? (F)1.0f : (F)2.0f);
  const V3 world = {t.x * view.s0 + t.y * view.s4 + t.z * view.s8,
                    t.x * view.s1 + t.y * view.s5 + t.z * view.s9,
                    t.x * view.s2 + t.y * view.s6 + t.z * view.sa};
  return world;
}

// Zero where the Gaussian was not drawn.
inline V3 only(const I drawn, const V3 v) {
  const V3 r = {drawn ? v.x : (F)0.0f, drawn ? v.y : (F)0.0f, drawn ? v.z : (F)0.0f};
  return r;
}

__kernel void project_gaussians_backward(
    const int n, const float16 view, const float4 intrinsics, const int2 size,
    __global const float *means, __global const float *quats, __global const float *log_scales,
    __global const float *opacity_logits, __global const int *radii,
    __global const float *moments, __global float *d_means, __global float *d_quats,
    __global float *d_log_scales, __global float *d_opacity_logits, __global float *mean2d_norm,
    __global uchar *visible) {
  const int first = get_global_id(0) * LANES;
  if (first >= n) return;
  const Footprint f = footprint(first, n, view, intrinsics, size, means, quats, log_scales);
  const I drawn = as_bits(load_field((__global const float *)radii, first, n, 1, 0)) > 0;
  const ScreenGradient g = screen_gradient(&f, moments, first, n);
  const F nx = g.x * (0.5f * size.x), ny = g.y * (0.5f * size.y);
  store_field(drawn ? sqrt(nx * nx + ny * ny) : (F)0.0f, mean2d_norm, first, n, 1, 0);
  const F d_logit = load_field(moments, first, n, 8, 0) /
                    (1.0f + exp_f(load_field(opacity_logits, first, n, 1, 0)));
  store_field(drawn ? d_logit : (F)0.0f, d_opacity_logits, first, n, 1, 0);

  // cov2d = rows rows^T, rows = (J W) (R S)
  const V3 d_row0 = weighted(2.0f * g.xx, f.row0, 2.0f * g.xy, f.row1);
  const V3 d_row1 = weighted(2.0f * g.xy, f.row0, 2.0f * g.yy, f.row1);
  const V3 e0 = times(d_row0, f.scale), e1 = times(d_row1, f.scale);
  const V3 d_jw0 = {dot3(e0, f.r0), dot3(e0, f.r1), dot3(e0, f.r2)};
  const V3 d_jw1 = {dot3(e1, f.r0), dot3(e1, f.r1), dot3(e1, f.r2)};
  const V3 g0 = weighted(f.jw0.x, e0, f.jw1.x, e1);  // rows of dL/dR
  const V3 g1 = weighted(f.jw0.y, e0, f.jw1.y, e1);
  const V3 g2 = weighted(f.jw0.z, e0, f.jw1.z, e1);
  const V3 s0 = times(g0, f.r0), s1 = times(g1, f.r1), s2 = times(g2, f.r2);
  const V3 d_log_scale = {s0.x + s1.x + s2.x, s0.y + s1.y + s2.y, s0.z + s1.z + s2.z};
  store_v3(only(drawn, d_log_scale), d_log_scales, first, n);
  F d_quat[4];
  quaternion_gradient(&f, g0, g1, g2, d_quat);
  for (int k = 0; k < 4; ++k)
    store_field(drawn ? d_quat[k] : (F)0.0f, d_quats, first, n, 4, k);
  const V3 d_mean = camera_gradient(&f, &g, d_jw0, d_jw1, load_field(moments, first, n, 8, 6), view,
                                    intrinsics);
  store_v3(only(drawn, d_mean), d_means, first, n);
  for (int i = first; i < min(first + LANES, n); ++i) visible[i] = radii[i] > 0;
}
