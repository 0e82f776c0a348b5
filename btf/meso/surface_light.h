// What every surface point receives from every light, solved once before any view is traced: visibility of
// each surface point, direct diffuse irradiance, and diffuse irradiance after several bounces.
//
// Irradiances are divided by pi (a light sends irradiance pi through a plane facing it) and weighted by the
// share the specular lobe leaves, 1 - E(n.wi) (microfacet.h): the diffuse value towards wo is
//   facet.diffuse[c] (1 - E(n.wo)) (visible * Direct + Indirect[c]).
//
// Bounces: each facet sends kGatherRays cosine-distributed rays once; where they land is a sparse matrix K
// shared by all lights, and I_0 = 0, I_(m+1) = K diag(diffuse) (D + I_m) is a sparse times dense product per
// bounce. Source: progressive Jacobi iteration of the rendering equation [Kajiya1986], form factors by cosine
// sampling.
#pragma once

#include <cstdint>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/meso/facets.h"
#include "btf/meso/height_field_scene.h"
#include "btf/meso/microfacet.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

class SurfaceLight {
 public:
  struct Options {
    int bounces = 2;
    int edge_parts = 2;  // facets.h
    uint64_t seed = 1;
  };

  // `lights` are unit vectors with z > 0. The result does not depend on the number of threads.
  // Progress: stages "visibility" and "interreflections", unit "points".
  // Errors: CANCELLED.
  static absl::StatusOr<SurfaceLight> Solve(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                                            const HeightFieldScene& scene, const SpecularAlbedo& specular,
                                            const std::vector<Eigen::Vector3d>& lights,
                                            const Options& options, const RunContext& context);

  // Bytes Solve needs at its peak for these sizes.
  static double PeakBytes(int64_t num_facets, int num_lights, int edge_parts, int bounces);

  // Lights per row of the tables: their number rounded up to whole SIMD registers; the excess is dark.
  [[nodiscard]] int stride() const { return stride_; }
  [[nodiscard]] const FacetParts& parts() const { return parts_; }
  // [stride], 1 where the surface point sees the light, else 0.
  [[nodiscard]] const uint8_t* Visibility(int64_t facet, int part) const {
    return visibility_.data() + (facet * parts_.count() + part) * stride_;
  }
  // [stride], cos (1 - E(cos)) on the facet where nothing is in the way; 0 when turned away.
  [[nodiscard]] const float* Direct(int64_t facet) const { return direct_.data() + facet * stride_; }
  // [3][stride]
  [[nodiscard]] const float* Indirect(int64_t facet) const { return indirect_.data() + facet * 3 * stride_; }

  static int StrideFor(int num_lights);

 private:
  SurfaceLight(int num_lights, int edge_parts, int64_t num_facets);

  absl::Status SolveDirect(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                           const HeightFieldScene& scene, const SpecularAlbedo& specular,
                           const std::vector<Eigen::Vector3d>& lights, const RunContext& context);
  absl::Status SolveBounces(const SurfaceMaps& maps, const std::vector<Facet>& facets,
                            const HeightFieldScene& scene, const SpecularAlbedo& specular,
                            const Options& options, const RunContext& context);

  int stride_;
  FacetParts parts_;
  std::vector<uint8_t> visibility_;  // [facet][part][stride]
  std::vector<float> direct_;        // [facet][stride]
  std::vector<float> indirect_;      // [facet][3][stride]
};

}  // namespace tessera
