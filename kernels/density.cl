// What density control does in every iteration, one work-item per Gaussian: statistics of the
// standard strategy (Kerbl et al. 2023, section 5), regularizers and noise of MCMC (Kheradmand et
// al. 2024, eq. 8 and 10). Quaternions are w-x-y-z. Compile-time: none.
#line 5 "density.cl"

// For each seen Gaussian the sum of its 2D gradient norms, how often it was seen, and its largest
// radius in pixels.
__kernel void accumulate(__global const float *norms, __global const int *radii,
                         __global const uchar *visible, const int n, __global float *norm_sums,
                         __global float *seen, __global float *largest_radius) {
  const int i = get_global_id(0);
  if (i >= n || visible[i] == 0) return;
  norm_sums[i] += norms[i];
  seen[i] += 1.0f;
  largest_radius[i] = fmax(largest_radius[i], (float)radii[i]);
}

// Adds d/d(logit) of opacity_weight · Σ sigmoid(logit) and d/d(log s) of scale_weight · Σ s.
__kernel void mcmc_regularize(__global const float *opacity_logits,
                              __global const float *log_scales, const int n,
                              const float opacity_weight, const float scale_weight,
                              __global float *d_opacity_logits, __global float *d_log_scales) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float o = 1.0f / (1.0f + exp(-opacity_logits[i]));
  d_opacity_logits[i] += opacity_weight * o * (1.0f - o);
  const float3 d = scale_weight * exp(vload3(i, log_scales));
  vstore3(vload3(i, d_log_scales) + d, i, d_log_scales);
}

// PCG3D of Jarzynski & Olano 2020: three random words from three counters, no state to keep.
uint3 random_words(uint3 v) {
  v = v * 1664525u + 1013904223u;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v ^= v >> 16;
  v.x += v.y * v.z;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  return v;
}

float unit_interval(uint word) { return ((word >> 8) + 0.5f) * (1.0f / 16777216.0f); }

float3 normal_numbers(uint3 counters) {
  const uint3 a = random_words(counters);
  const uint3 b = random_words(a);
  const float r0 = sqrt(-2.0f * log(unit_interval(a.x)));
  const float r1 = sqrt(-2.0f * log(unit_interval(a.z)));
  const float t0 = 6.2831853f * unit_interval(a.y), t1 = 6.2831853f * unit_interval(b.x);
  return (float3)(r0 * cos(t0), r0 * sin(t0), r1 * cos(t1));
}

float3 turn(float4 q, float3 v) {
  const float3 t = 2.0f * cross(q.yzw, v);
  return v + q.x * t + cross(q.yzw, t);
}

// mean += strength · gate(opacity) · Σ · noise: faint Gaussians wander within their own shape.
__kernel void mcmc_noise(__global float *means, __global const float *quats,
                         __global const float *log_scales, __global const float *opacity_logits,
                         const int n, const uint seed, const uint iteration,
                         const float strength) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float o = 1.0f / (1.0f + exp(-opacity_logits[i]));
  const float gate = 1.0f / (1.0f + exp(-100.0f * (0.005f - o)));
  float4 q = vload4(i, quats);
  q *= rsqrt(fmax(dot(q, q), 1e-24f));
  const float3 variance = exp(2.0f * vload3(i, log_scales));
  const float4 back = (float4)(q.x, -q.y, -q.z, -q.w);
  const float3 noise = normal_numbers((uint3)((uint)i, iteration, seed));
  const float3 step = turn(q, variance * turn(back, noise));
  vstore3(vload3(i, means) + strength * gate * step, i, means);
}
