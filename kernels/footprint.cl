// The footprint of a 3D Gaussian on the screen, shared by projection and its derivative.
//
// Zwicker et al. 2002; Kerbl et al. 2023, eq. 5: cov2d = J W Sigma W^T J^T + EPS2D I, with
// Sigma = R S S^T R^T. The determinant is a sum of squares (Cauchy-Binet), so that a needle cannot
// make it negative. Compile-time: NEAR_M, EPS2D, ANTIALIASED, COMPENSATION_MIN.
#include "common.cl"
#line 7 "footprint.cl"

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
