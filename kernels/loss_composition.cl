// Composition loss and its gradients: |T(Σ_m w_m x_m) - photo|, T(v) = (v + β)^(1/γ), mean over
// pixels and colours (supplement, L_comp). x holds M rgb images side by side, in units where lamp
// m has radiance x_m · unit_m; w is [M, 3].
//
// Learnt values: params = [w (3M), raw β, raw γ], with β = BETA_MIN + softplus(raw) and
// γ = GAMMA_MIN + (GAMMA_MAX - GAMMA_MIN) · sigmoid(raw): without the floor and the bounds,
// (v + β)^(1/γ) has no derivative at v + β = 0 and none that is finite as γ → 0.
// A photo clips what is brighter than white: at CLIPPED a brighter composition is no error.
// Torch twin: luxcore/splats/losses/twin.py::composition_loss.
// Compile-time: HEIGHT, WIDTH, LIGHTS, BETA_MIN, GAMMA_MIN, GAMMA_MAX, CLIPPED.
#line 13 "loss_composition.cl"

#define PARAMS (3 * LIGHTS + 2)
#define COLUMNS (PARAMS + 1)

float sigmoid(float v) { return 1.0f / (1.0f + exp(-v)); }
float softplus(float v) { return v > 20.0f ? v : log1p(exp(v)); }

// One work-item per image row: adds to d_x [H, W, 3M], writes partials [H, 3M + 3] = gradients of
// params, then the sum of errors.
__kernel void composition_rows(__global const float *x, __global const float *photo,
                               __global const float *params, __global const float *unit,
                               const float scale, __global float *d_x,
                               __global float *partials) {
  const int row = get_global_id(0);
  const float raw_beta = params[3 * LIGHTS], raw_gamma = params[3 * LIGHTS + 1];
  const float beta = BETA_MIN + softplus(raw_beta);
  const float s = sigmoid(raw_gamma);
  const float gamma = GAMMA_MIN + (GAMMA_MAX - GAMMA_MIN) * s;
  const float power = 1.0f / gamma;
  float3 weight[LIGHTS], d_weight[LIGHTS];
  for (int m = 0; m < LIGHTS; ++m) {
    weight[m] = vload3(m, params) * unit[m];
    d_weight[m] = (float3)(0.0f);
  }
  float3 d_beta = (float3)(0.0f), d_power = (float3)(0.0f), errors = (float3)(0.0f);
  for (int col = 0; col < WIDTH; ++col) {
    const size_t pixel = (size_t)row * WIDTH + col;
    __global const float *in = x + pixel * 3 * LIGHTS;
    __global float *out = d_x + pixel * 3 * LIGHTS;
    float3 total = (float3)(0.0f);
    for (int m = 0; m < LIGHTS; ++m) total += weight[m] * vload3(m, in);
    // Weights and radiances below zero may add up to less than -β early in a run.
    const float3 v = fmax(total, 0.0f) + beta;
    const float3 target = vload3(pixel, photo);
    const float3 log_v = log(v), tone = exp(power * log_v);
    const float3 error = tone - target;
    const int3 ignored = target >= CLIPPED && error > 0.0f;
    const float3 d_tone = ignored ? (float3)(0.0f) : scale * sign(error);
    const float3 d_v = d_tone * power * tone / v;
    const float3 d_total = total > 0.0f ? d_v : (float3)(0.0f);
    for (int m = 0; m < LIGHTS; ++m) {
      vstore3(vload3(m, out) + d_total * weight[m], m, out);
      d_weight[m] += d_total * vload3(m, in);
    }
    d_beta += d_v;
    d_power += d_tone * tone * log_v;
    errors += ignored ? (float3)(0.0f) : fabs(error);
  }
  __global float *sums = partials + row * COLUMNS;
  for (int m = 0; m < LIGHTS; ++m) vstore3(d_weight[m] * unit[m], m, sums);
  sums[3 * LIGHTS] = (d_beta.x + d_beta.y + d_beta.z) * sigmoid(raw_beta);
  sums[3 * LIGHTS + 1] = -(d_power.x + d_power.y + d_power.z) * power * power *
                         (GAMMA_MAX - GAMMA_MIN) * s * (1.0f - s);
  sums[PARAMS] = errors.x + errors.y + errors.z;
}
