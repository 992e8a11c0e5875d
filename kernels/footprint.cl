// The footprint of 3D Gaussians on the screen, shared by projection and its derivative.
//
// Zwicker et al. 2002; Kerbl et al. 2023, eq. 5: cov2d = J W Sigma W^T J^T + EPS2D I, with
// Sigma = R S S^T R^T. The determinant is a sum of squares (Cauchy-Binet), so that a needle cannot
// make it negative. Compile-time: LANES, NEAR_M, EPS2D, ANTIALIASED, COMPENSATION_MIN.
#include "lanes.cl"
#line 8 "footprint.cl"

typedef struct {
  I valid;          // seen, and every input is a number
  V3 t;             // mean in camera axes; a point ahead where it is not valid
  V3 r0, r1, r2;    // rows of the rotation R
  V3 jw0, jw1;      // rows of J W
  V3 a0, a1;        // rows of J W R
  V3 minors;        // a0 x a1
  V3 scale;
  F w, x, y, z;     // unit quaternion
  F quat_norm;
  F tx, ty;         // x and y that the Jacobian uses, clamped
  I clamped_x, clamped_y;
  F xx, xy, yy;     // cov2d
  F det_sharp, det; // of cov2d without and with the low-pass
} Footprint;

inline void rotate(Footprint *f) {
  const F w = f->w, x = f->x, y = f->y, z = f->z;
  const V3 r0 = {1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y - w * z), 2.0f * (x * z + w * y)};
  const V3 r1 = {2.0f * (x * y + w * z), 1.0f - 2.0f * (x * x + z * z), 2.0f * (y * z - w * x)};
  const V3 r2 = {2.0f * (x * z - w * y), 2.0f * (y * z + w * x), 1.0f - 2.0f * (x * x + y * y)};
  f->r0 = r0;
  f->r1 = r1;
  f->r2 = r2;
}

// J: row 0 is (fx / z, 0, -fx tx / z^2). x / z is clamped 15 % of the image's size beyond its true
// borders: further out, the linear approximation explodes.
inline void linearise(Footprint *f, const float16 view, const float4 intrinsics, const int2 size) {
  const float fx = intrinsics.x, fy = intrinsics.y, cx = intrinsics.z, cy = intrinsics.w;
  const float margin_x = 0.15f * size.x / fx, margin_y = 0.15f * size.y / fy;
  const F inverse_z = 1.0f / f->t.z, x = f->t.x * inverse_z, y = f->t.y * inverse_z;
  const F kx = fmin(fmax(x, (F)(-cx / fx - margin_x)), (F)((size.x - cx) / fx + margin_x));
  const F ky = fmin(fmax(y, (F)(-cy / fy - margin_y)), (F)((size.y - cy) / fy + margin_y));
  f->clamped_x = kx != x;
  f->clamped_y = ky != y;
  f->tx = kx * f->t.z;
  f->ty = ky * f->t.z;
  const F jx = fx * inverse_z, jy = fy * inverse_z;
  const V3 jw0 = {jx * (view.s0 - kx * view.s8), jx * (view.s1 - kx * view.s9),
                  jx * (view.s2 - kx * view.sa)};
  const V3 jw1 = {jy * (view.s4 - ky * view.s8), jy * (view.s5 - ky * view.s9),
                  jy * (view.s6 - ky * view.sa)};
  f->jw0 = jw0;
  f->jw1 = jw1;
}

inline V3 along_axes(const Footprint *f, const V3 jw) {
  const V3 r = {fma(jw.x, f->r0.x, fma(jw.y, f->r1.x, jw.z * f->r2.x)),
                fma(jw.x, f->r0.y, fma(jw.y, f->r1.y, jw.z * f->r2.y)),
                fma(jw.x, f->r0.z, fma(jw.y, f->r1.z, jw.z * f->r2.z))};
  return r;
}

Footprint footprint(const int first, const int n, const float16 view, const float4 intrinsics,
                    const int2 size, __global const float *means, __global const float *quats,
                    __global const float *log_scales) {
  Footprint f;
  const V3 m = load_v3(means, first, n), log_scale = load_v3(log_scales, first, n);
  const F w = load_field(quats, first, n, 4, 0), x = load_field(quats, first, n, 4, 1);
  const F y = load_field(quats, first, n, 4, 2), z = load_field(quats, first, n, 4, 3);
  const F tx = fma(m.x, view.s0, fma(m.y, view.s1, fma(m.z, view.s2, (F)view.s3)));
  const F ty = fma(m.x, view.s4, fma(m.y, view.s5, fma(m.z, view.s6, (F)view.s7)));
  const F tz = fma(m.x, view.s8, fma(m.y, view.s9, fma(m.z, view.sa, (F)view.sb)));
  const F norm2 = fma(w, w, fma(x, x, fma(y, y, z * z)));
  // Nothing is divided by z or by the norm before both were looked at. A sum with a NaN is NaN.
  const F sum = tx + ty + tz + norm2 + log_scale.x + log_scale.y + log_scale.z;
  f.valid = tz >= NEAR_M && norm2 > 1e-24f && fabs(sum) < 1e30f;
  const V3 t = {f.valid ? tx : (F)0.0f, f.valid ? ty : (F)0.0f, f.valid ? tz : (F)1.0f};
  f.t = t;
  f.quat_norm = sqrt(f.valid ? norm2 : (F)1.0f);
  const F inverse = 1.0f / f.quat_norm;
  f.w = f.valid ? w * inverse : (F)1.0f;
  f.x = f.valid ? x * inverse : (F)0.0f;
  f.y = f.valid ? y * inverse : (F)0.0f;
  f.z = f.valid ? z * inverse : (F)0.0f;
  const V3 scale = {exp_f(log_scale.x), exp_f(log_scale.y), exp_f(log_scale.z)};
  f.scale = scale;
  rotate(&f);
  linearise(&f, view, intrinsics, size);
  f.a0 = along_axes(&f, f.jw0);
  f.a1 = along_axes(&f, f.jw1);
  f.minors = cross3(f.a0, f.a1);
  const V3 row0 = times(f.a0, scale), row1 = times(f.a1, scale);
  const F xx = dot3(row0, row0), yy = dot3(row1, row1);
  const V3 areas = {scale.y * scale.z, scale.z * scale.x, scale.x * scale.y};
  const V3 minors = times(f.minors, areas);  // row0 x row1
  f.xy = dot3(row0, row1);
  f.det_sharp = dot3(minors, minors);
  f.det = fma(xx + yy, (F)EPS2D, f.det_sharp + EPS2D * EPS2D);
  f.xx = xx + EPS2D;
  f.yy = yy + EPS2D;
  f.valid = f.valid && f.det < 1e30f;
  return f;
}

// log2 of the factor that keeps a Gaussian's total light when the low-pass widens it.
inline F log2_compensation(const Footprint *f) {
#if ANTIALIASED
  return 0.5f * log2_f(fmax(f->det_sharp / f->det, (F)(COMPENSATION_MIN * COMPENSATION_MIN)));
#else
  return (F)0.0f;
#endif
}
