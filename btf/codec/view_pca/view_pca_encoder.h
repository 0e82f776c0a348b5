// Encoding of "view-pca": for each view, the principal components over the lights of all texels and channels
// [PCAWang 3].
//
// With the images of view v as the rows of a matrix T (lights x texels and channels) and its mean image
// subtracted, eigen-texture m is a(m)^T (T - mean) for the m-th eigenvector a(m) of the lights x lights
// covariance; an image is mean + sum over m of a(light, m) eigen-texture m. Eigenvectors are of unit length,
// so the weights fit 16 bits. Differs from the paper only in what it leaves open: lights count alike, and the
// three channels share their weights. (Its equation 1 is missing from our copy: rebuilt from the text.)
#pragma once

#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/codec/codec.h"
#include "btf/data/btf_source.h"

namespace tessera {

// As Codec::Encode for "view-pca" with params.eigen_textures, 1 to 255; no more than lights - 1 are stored,
// which is exact up to quantisation. Reads the source twice. Holds, besides the result's codes, views x
// lights x lights doubles and at least one row of samples, at most params.memory_budget_bytes; float
// coefficients that exceed it go to a spill file. The result depends neither on the budget nor
// on the number of threads. Errors: INVALID_ARGUMENT naming eigen_textures, a direction or the view, light
// and texel of a sample that is not finite or beyond kLargestSample (encoder_input.h); RESOURCE_EXHAUSTED
// (the covariances exceed the budget, temporary folder); CANCELLED; whatever the source returns.
[[nodiscard]] absl::StatusOr<Material> EncodeViewPca(BtfSource& source, const EncodeParams& params,
                                                     const RunContext& context);

}  // namespace tessera
