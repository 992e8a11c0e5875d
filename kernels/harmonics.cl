// Real spherical harmonics to colour and back, degree 0..3, one work-item per Gaussian.
//
// Basis and signs of Sloan 2013 as used by 3DGS: rgb = sum_k b_k(dir) c_k + 0.5, dir = normalised
// (mean - camera centre). coefficients [n, K, 3]. Compile-time: DEGREE (of the evaluation), K
// (stored coefficients, >= (DEGREE+1)^2), CLAMP (rgb = max(rgb, 0), zero gradient below).
#line 7 "harmonics.cl"

#ifndef DEGREE
#define DEGREE 3
#endif
#ifndef K
#define K 16
#endif
#ifndef CLAMP
#define CLAMP 1
#endif
#define USED ((DEGREE + 1) * (DEGREE + 1))

void basis(const float3 d, float *b) {
  b[0] = 0.28209479177387814f;
#if DEGREE > 0
  b[1] = -0.48860251190292f * d.y;
  b[2] = 0.48860251190292f * d.z;
  b[3] = -0.48860251190292f * d.x;
#endif
#if DEGREE > 1
  const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  b[4] = 1.0925484305920792f * d.x * d.y;
  b[5] = -1.0925484305920792f * d.y * d.z;
  b[6] = 0.31539156525252005f * (2 * zz - xx - yy);
  b[7] = -1.0925484305920792f * d.x * d.z;
  b[8] = 0.5462742152960396f * (xx - yy);
#endif
#if DEGREE > 2
  b[9] = -0.5900435899266435f * d.y * (3 * xx - yy);
  b[10] = 2.890611442640554f * d.x * d.y * d.z;
  b[11] = -0.4570457994644658f * d.y * (4 * zz - xx - yy);
  b[12] = 0.3731763325901154f * d.z * (2 * zz - 3 * xx - 3 * yy);
  b[13] = -0.4570457994644658f * d.x * (4 * zz - xx - yy);
  b[14] = 1.445305721320277f * d.z * (xx - yy);
  b[15] = -0.5900435899266435f * d.x * (xx - 3 * yy);
#endif
}

// Adds s * gradient of basis function k for all k: returns sum_k w_k grad b_k.
float3 basis_gradient(const float3 d, const float *w) {
  float3 g = (float3)(0);
#if DEGREE > 0
  g += 0.48860251190292f * (float3)(-w[3], -w[1], w[2]);
#endif
#if DEGREE > 1
  const float x = d.x, y = d.y, z = d.z, c = 1.0925484305920792f;
  g += c * (w[4] * (float3)(y, x, 0) - w[5] * (float3)(0, z, y) - w[7] * (float3)(z, 0, x) +
            w[8] * (float3)(x, -y, 0));
  g += 0.31539156525252005f * w[6] * (float3)(-2 * x, -2 * y, 4 * z);
#endif
#if DEGREE > 2
  const float xx = x * x, yy = y * y, zz = z * z;
  g -= 0.5900435899266435f * w[9] * (float3)(6 * x * y, 3 * xx - 3 * yy, 0);
  g += 2.890611442640554f * w[10] * (float3)(y * z, x * z, x * y);
  g -= 0.4570457994644658f * w[11] * (float3)(-2 * x * y, 4 * zz - xx - 3 * yy, 8 * y * z);
  g += 0.3731763325901154f * w[12] * (float3)(-6 * x * z, -6 * y * z, 6 * zz - 3 * xx - 3 * yy);
  g -= 0.4570457994644658f * w[13] * (float3)(4 * zz - 3 * xx - yy, -2 * x * y, 8 * x * z);
  g += 1.445305721320277f * w[14] * (float3)(2 * x * z, -2 * y * z, xx - yy);
  g -= 0.5900435899266435f * w[15] * (float3)(3 * xx - 3 * yy, -6 * x * y, 0);
#endif
  return g;
}

__kernel void harmonics_forward(const int n, const float4 centre, __global const float *means,
                                __global const float *coefficients, __global float *rgb) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float3 v = vload3(i, means) - centre.xyz;
  float b[USED];
  basis(v * rsqrt(fmax(dot(v, v), 1e-24f)), b);
  float3 sum = (float3)(0.5f);
  for (int k = 0; k < USED; ++k) sum += b[k] * vload3(i * K + k, coefficients);
#if CLAMP
  sum = fmax(sum, 0.0f);
#endif
  vstore3(sum, i, rgb);
}

__kernel void harmonics_backward(const int n, const float4 centre, __global const float *means,
                                 __global const float *coefficients, __global const float *rgb,
                                 __global const float *d_rgb, __global float *d_coefficients,
                                 __global float *d_means) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float3 v = vload3(i, means) - centre.xyz;
  const float inverse = rsqrt(fmax(dot(v, v), 1e-24f));
  const float3 dir = v * inverse;
  float b[USED];
  basis(dir, b);
  float3 d = vload3(i, d_rgb);
#if CLAMP
  const float3 value = vload3(i, rgb);
  d = (float3)(value.x > 0 ? d.x : 0, value.y > 0 ? d.y : 0, value.z > 0 ? d.z : 0);
#endif
  float w[USED];
  for (int k = 0; k < USED; ++k) {
    vstore3(b[k] * d, i * K + k, d_coefficients);
    w[k] = dot(vload3(i * K + k, coefficients), d);
  }
  for (int k = USED; k < K; ++k) vstore3((float3)(0), i * K + k, d_coefficients);
  const float3 g = basis_gradient(dir, w);
  vstore3((g - dir * dot(g, dir)) * inverse, i, d_means);
}
