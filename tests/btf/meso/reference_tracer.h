// The slow, obvious way: paths over a height field in double precision, cell by cell, without Embree, tables
// or links. Shares nothing with btf/meso but the description of the surface (surface_maps.h).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "btf/base/rng.h"
#include "btf/meso/surface_maps.h"

namespace tessera {

struct ReferenceHit {
  bool found = false;
  double distance = 0.0;
  int64_t facet = -1;
  Eigen::Vector3d point;
  Eigen::Vector3d normal;
  std::array<double, 3> albedo{};
  double roughness = 0.0;
};

// Mean of the sampled paths and the standard error of that mean, per light and channel.
struct ReferenceEstimate {
  std::vector<std::array<double, 3>> mean;
  std::vector<std::array<double, 3>> standard_error;
};

class ReferenceTracer {
 public:
  explicit ReferenceTracer(const SurfaceMaps& maps);

  // The nearest facet along a ray; walks the cells its shadow on the ground crosses.
  [[nodiscard]] ReferenceHit Trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const;

  // Value of texel (x, row) by `num_paths` paths of up to `bounces` diffuse interreflections.
  [[nodiscard]] ReferenceEstimate Texel(int x, int row, const Eigen::Vector3d& wo,
                                        const std::vector<Eigen::Vector3d>& lights, int bounces,
                                        int num_paths, uint64_t seed) const;

  // Albedo of the GGX lobe for light along mu, by quadrature over the hemisphere of directions.
  static double LobeAlbedo(double mu, double roughness, double f0);
  // pi f_s (wo, wi), both in the frame of the normal.
  static double LobeTimesPi(const Eigen::Vector3d& wo, const Eigen::Vector3d& wi, double roughness,
                            double f0);

 private:
  [[nodiscard]] Eigen::Vector3d Vertex(int column, int row) const;
  // Left-over shares 1 - E(mu), (1 - E_avg): by quadrature, kept for the one roughness of the maps.
  [[nodiscard]] double LeftOver(double mu) const;

  const SurfaceMaps& maps_;
  double lowest_ = 0.0;
  double highest_ = 0.0;
  double roughness_ = 1.0;  // the maps must have one roughness
  std::vector<double> left_over_;
  double average_left_over_ = 1.0;
};

}  // namespace tessera
