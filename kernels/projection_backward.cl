// Derivative of the projection (see footprint.cl): from what blending left per Gaussian to means,
// quaternions, log-scales and opacity logits. LANES Gaussians per work-item, n in all.
//
// moments [n, 8]: with h = dL/d ln(alpha) of a pixel and d = mean2d - pixel, the sums over pixels of
// h, h dx, h dy, h dx^2, h dx dy, h dy^2, then dL/d depth.
// mean2d_norm is the length of dL/d mean2d in units of half the image size.
#include "footprint.cl"
#line 9 "projection_backward.cl"

typedef struct {
  F x, y;                    // dL/d mean2d
  V3 d_a0, d_a1;             // dL/d (J W R)
  V3 d_log_scale, d_turn;    // by the log-scales; by a turn about each axis of the Gaussian
} ScreenGradient;

// B = cov2d^-1 A without cancellation, cov2d = A S S A^T + e I of determinant `det`, A = J W R: by
// the triple product, |r1|^2 r0 - (r0 r1) r1 = r1 x (r0 x r1) for the rows r of A S. Taken from the
// entries of cov2d^-1, a needle's long axis would be the difference of numbers as much larger as
// the needle is longer than a pixel.
inline void whiten(const Footprint *f, const V3 squares, const F e, const F det, V3 *b0, V3 *b1) {
  const F inverse = 1.0f / det;
  *b0 = weighted(inverse, cross3(times(f->a1, squares), f->minors), e * inverse, f->a0);
  *b1 = weighted(inverse, cross3(f->minors, times(f->a0, squares)), e * inverse, f->a1);
}

// ln alpha = ln opacity - (a dx^2 + c dy^2) / 2 - b dx dy with the conic [[a, b], [b, c]] = cov2d^-1,
// so d_cov = conic V conic, V = 1/2 [[h dx^2, h dx dy], [h dx dy, h dy^2]]. With B = conic A,
//   dL/dA = 2 conic V B S^2, dL/d log s_k = H_kk s_k^2, H = 2 B^T V B,
// and a turn about axis x of the Gaussian changes the loss by H_yz (s_y^2 - s_z^2).
ScreenGradient screen_gradient(const Footprint *f, __global const float *moments, const int first,
                               const int n) {
  const F inverse = 1.0f / f->det;
  const F a = f->yy * inverse, b = -f->xy * inverse, c = f->xx * inverse;
  const F hx = load_field(moments, first, n, 8, 1), hy = load_field(moments, first, n, 8, 2);
  const F va = load_field(moments, first, n, 8, 3), vb = load_field(moments, first, n, 8, 4);
  const F vc = load_field(moments, first, n, 8, 5);
  const V3 squares = times(f->scale, f->scale);
  V3 b0, b1;
  whiten(f, squares, EPS2D, f->det, &b0, &b1);
  const V3 y0 = weighted(va, b0, vb, b1), y1 = weighted(vb, b0, vc, b1);  // 2 V B
  ScreenGradient g;
  g.x = -(a * hx + b * hy);
  g.y = -(b * hx + c * hy);
  g.d_a0 = times(weighted(a, y0, b, y1), squares);
  g.d_a1 = times(weighted(b, y0, c, y1), squares);
  const V3 diagonal = {b0.x * y0.x + b1.x * y1.x, b0.y * y0.y + b1.y * y1.y,
                       b0.z * y0.z + b1.z * y1.z};
  g.d_log_scale = times(diagonal, squares);
  g.d_turn.x = (b0.y * y0.z + b1.y * y1.z) * (squares.y - squares.z);
  g.d_turn.y = (b0.z * y0.x + b1.z * y1.x) * (squares.z - squares.x);
  g.d_turn.z = (b0.x * y0.y + b1.x * y1.y) * (squares.x - squares.y);
#if ANTIALIASED
  // d ln sqrt(det_sharp / det) / d cov = (cov_sharp^-1 - cov^-1) / 2, nothing at the floor.
  const I above = f->det_sharp > COMPENSATION_MIN * COMPENSATION_MIN * f->det;
  const F k = above ? load_field(moments, first, n, 8, 0) : (F)0.0f;
  V3 s0, s1;
  whiten(f, squares, 0.0f, above ? f->det_sharp : (F)1.0f, &s0, &s1);
  const V3 e0 = times(weighted(k, s0, -k, b0), squares);
  const V3 e1 = times(weighted(k, s1, -k, b1), squares);
  g.d_a0 = weighted((F)1.0f, g.d_a0, (F)1.0f, e0);
  g.d_a1 = weighted((F)1.0f, g.d_a1, (F)1.0f, e1);
  const V3 own = weighted((F)1.0f, times(f->a0, e0), (F)1.0f, times(f->a1, e1));
  g.d_log_scale = weighted((F)1.0f, g.d_log_scale, (F)1.0f, own);
  g.d_turn.x += f->a0.z * e0.y + f->a1.z * e1.y - f->a0.y * e0.z - f->a1.y * e1.z;
  g.d_turn.y += f->a0.x * e0.z + f->a1.x * e1.z - f->a0.z * e0.x - f->a1.z * e1.x;
  g.d_turn.z += f->a0.y * e0.x + f->a1.y * e1.x - f->a0.x * e0.y - f->a1.x * e1.y;
#endif
  return g;
}

// Through the normalisation of q: a turn by t about the Gaussian's axes moves the unit quaternion by
// q (0, t / 2), which is orthogonal to q.
void quaternion_gradient(const Footprint *f, const V3 d_turn, F *d_quat) {
  const F w = f->w, x = f->x, y = f->y, z = f->z;
  const V3 t = scaled(d_turn, 2.0f / f->quat_norm);
  d_quat[0] = -(t.x * x + t.y * y + t.z * z);
  d_quat[1] = t.x * w - t.y * z + t.z * y;
  d_quat[2] = t.x * z + t.y * w - t.z * x;
  d_quat[3] = -t.x * y + t.y * x + t.z * w;
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

  const V3 d_jw0 = {dot3(g.d_a0, f.r0), dot3(g.d_a0, f.r1), dot3(g.d_a0, f.r2)};
  const V3 d_jw1 = {dot3(g.d_a1, f.r0), dot3(g.d_a1, f.r1), dot3(g.d_a1, f.r2)};
  store_v3(only(drawn, g.d_log_scale), d_log_scales, first, n);
  F d_quat[4];
  quaternion_gradient(&f, g.d_turn, d_quat);
  for (int k = 0; k < 4; ++k)
    store_field(drawn ? d_quat[k] : (F)0.0f, d_quats, first, n, 4, k);
  const V3 d_mean = camera_gradient(&f, &g, d_jw0, d_jw1, load_field(moments, first, n, 8, 6), view,
                                    intrinsics);
  store_v3(only(drawn, d_mean), d_means, first, n);
  for (int i = first; i < min(first + LANES, n); ++i) visible[i] = radii[i] > 0;
}
