// Adam (Kingma & Ba 2015), one work-item per value, in place.
//
// A row (one Gaussian) whose `visible` is 0 is left alone, moments included: under a loss of one
// view an unseen Gaussian has gradient zero in every entry, and stepping it would only let old
// momentum move it. A step with a loss of all Gaussians marks all of them as visible.
// The first `head` values of a row step by `rate` and are kept >= `lower`; the rest step by
// `tail_rate` (higher spherical harmonics). The bound is a projection after the step, which, unlike
// a clamp in the forward pass, does not stop the gradient.
// Twin: torch.optim.Adam (all visible). Compile-time: none.
#line 11 "adam.cl"

__kernel void adam(__global float *values, __global const float *gradients,
                   __global float *first, __global float *second,
                   __global const uchar *visible, const int width, const int size,
                   const int head, const float rate, const float tail_rate, const float beta1,
                   const float beta2, const float epsilon, const float correction1,
                   const float correction2, const float lower) {
  const int i = get_global_id(0);
  if (i >= size || visible[i / width] == 0) return;
  const float g = gradients[i];
  const float m = beta1 * first[i] + (1.0f - beta1) * g;
  const float v = beta2 * second[i] + (1.0f - beta2) * g * g;
  first[i] = m;
  second[i] = v;
  const float direction = (m / correction1) / (sqrt(v / correction2) + epsilon);
  const int in_head = i % width < head;
  const float next = values[i] - (in_head ? rate : tail_rate) * direction;
  values[i] = in_head ? fmax(next, lower) : next;
}
