#include "tests/btf/meso/reference_tracer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "btf/math/conventions.h"

namespace tessera {
namespace {

constexpr int kLeftOverNodes = 256;
constexpr double kOffset = 1e-6;  // texels, off the facet a ray starts on

int Wrap(int i, int n) {
  return ((i % n) + n) % n;
}

Eigen::Matrix3d FrameOf(const Eigen::Vector3d& n) {
  Eigen::Matrix3d frame;
  const Eigen::Vector3d any = std::abs(n.x()) < 0.5 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  frame.col(0) = any.cross(n).normalized();
  frame.col(1) = n.cross(frame.col(0));
  frame.col(2) = n;
  return frame;
}

}  // namespace

ReferenceTracer::ReferenceTracer(const SurfaceMaps& maps) : maps_(maps) {
  const auto [low, high] = std::minmax_element(maps.height.begin(), maps.height.end());
  lowest_ = *low;
  highest_ = *high;
  roughness_ = maps.roughness.front();
  left_over_.assign(kLeftOverNodes + 1, 1.0);
  if (maps.specular_f0 > 0.0F) {
    double average = 0.0;
    for (int i = 0; i <= kLeftOverNodes; ++i) {
      const double mu = std::max(1e-3, static_cast<double>(i) / kLeftOverNodes);
      left_over_[i] = 1.0 - LobeAlbedo(mu, roughness_, maps.specular_f0);
      average +=
          (i == 0 || i == kLeftOverNodes ? 0.5 : 1.0) * 2.0 * (1.0 - left_over_[i]) * mu / kLeftOverNodes;
    }
    average_left_over_ = 1.0 - average;
  }
}

double ReferenceTracer::LobeTimesPi(const Eigen::Vector3d& wo, const Eigen::Vector3d& wi, double roughness,
                                    double f0) {
  if (wo.z() <= 0.0 || wi.z() <= 0.0 || f0 <= 0.0) {
    return 0.0;
  }
  const double alpha = roughness * roughness;
  const Eigen::Vector3d h = (wo + wi).normalized();
  const double tan2_h = (1.0 - h.z() * h.z()) / (h.z() * h.z());
  // Walter et al. 2007, eq. 33, and Heitz 2014, eq. 72 and 99.
  const double d =
      1.0 / (kPi * alpha * alpha * std::pow(h.z(), 4) * std::pow(1.0 + tan2_h / (alpha * alpha), 2));
  const auto lambda = [&](double mu) {
    return (std::sqrt(1.0 + alpha * alpha * (1.0 - mu * mu) / (mu * mu)) - 1.0) / 2.0;
  };
  const double g = 1.0 / (1.0 + lambda(wo.z()) + lambda(wi.z()));
  const double f = f0 + (1.0 - f0) * std::pow(1.0 - wo.dot(h), 5);
  return kPi * d * g * f / (4.0 * wo.z() * wi.z());
}

double ReferenceTracer::LobeAlbedo(double mu, double roughness, double f0) {
  // Over half vectors, where the lobe is smooth: dwi = 4 (wo.h) dh. Midpoints in polar angle and azimuth.
  constexpr int kPolar = 400;
  constexpr int kAzimuth = 200;
  const Eigen::Vector3d wo(std::sqrt(std::max(0.0, 1.0 - mu * mu)), 0.0, mu);
  double sum = 0.0;
  for (int p = 0; p < kPolar; ++p) {
    const double theta = (p + 0.5) / kPolar * kPi / 2.0;
    for (int a = 0; a < kAzimuth; ++a) {
      const double phi = (a + 0.5) / kAzimuth * kPi;  // symmetric about the plane of incidence
      const Eigen::Vector3d h(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                              std::cos(theta));
      const double cos_h = wo.dot(h);
      if (cos_h <= 0.0) {
        continue;
      }
      const Eigen::Vector3d wi = 2.0 * cos_h * h - wo;
      sum += LobeTimesPi(wo, wi, roughness, f0) / kPi * std::max(0.0, wi.z()) * 4.0 * cos_h * std::sin(theta);
    }
  }
  return 2.0 * sum * (kPi / 2.0 / kPolar) * (kPi / kAzimuth);
}

Eigen::Vector3d ReferenceTracer::Vertex(int column, int row) const {
  const int n = maps_.resolution();
  return {static_cast<double>(column) / maps_.cells_per_texel,
          maps_.size - static_cast<double>(row) / maps_.cells_per_texel,
          maps_.height[static_cast<size_t>(Wrap(row, n)) * n + Wrap(column, n)]};
}

double ReferenceTracer::LeftOver(double mu) const {
  const double x = std::clamp(mu, 0.0, 1.0) * kLeftOverNodes;
  const int i = std::min(kLeftOverNodes - 1, static_cast<int>(x));
  return left_over_[i] + (x - i) * (left_over_[i + 1] - left_over_[i]);
}

ReferenceHit ReferenceTracer::Trace(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
  const double infinity = std::numeric_limits<double>::infinity();
  const int n = maps_.resolution();
  const double m = maps_.cells_per_texel;
  // In cell coordinates: columns grow with x, rows against y.
  const double column0 = origin.x() * m;
  const double row0 = (maps_.size - origin.y()) * m;
  const double d_column = direction.x() * m;
  const double d_row = -direction.y() * m;
  int column = static_cast<int>(std::floor(column0));
  int row = static_cast<int>(std::floor(row0));
  ReferenceHit best;
  best.distance = infinity;
  double enter = 0.0;
  for (int step = 0; step < 100000; ++step) {
    // Both facets of this cell, by the plane and three edge signs.
    for (int k = 0; k < 2; ++k) {
      const FacetCorners corners = CornersOfFacet(Wrap(column, n), Wrap(row, n), k);
      std::array<Eigen::Vector3d, 3> p;
      for (int c = 0; c < 3; ++c) {
        p[c] = Vertex(column + corners[c][0], row + corners[c][1]);
      }
      const Eigen::Vector3d normal = (p[1] - p[0]).cross(p[2] - p[0]).normalized();
      const double slope = normal.dot(direction);
      if (slope == 0.0) {
        continue;
      }
      const double t = normal.dot(p[0] - origin) / slope;
      if (t < 0.0 || t >= best.distance) {
        continue;
      }
      const Eigen::Vector3d point = origin + t * direction;
      bool inside = true;
      for (int c = 0; c < 3; ++c) {
        inside = inside && normal.dot((p[(c + 1) % 3] - p[c]).cross(point - p[c])) >= -1e-12;
      }
      if (inside) {
        best.found = true;
        best.distance = t;
        best.facet = 2 * (static_cast<int64_t>(Wrap(row, n)) * n + Wrap(column, n)) + k;
        best.point = point;
        best.normal = normal;
        best.albedo = {};
        best.roughness = roughness_;
        for (const auto& corner : corners) {
          const size_t vertex =
              static_cast<size_t>(Wrap(row + corner[1], n)) * n + Wrap(column + corner[0], n);
          for (int c = 0; c < 3; ++c) {
            best.albedo[c] += maps_.albedo[3 * vertex + c] / 3.0;
          }
        }
      }
    }
    const double exit_column = d_column > 0.0   ? (column + 1 - column0) / d_column
                               : d_column < 0.0 ? (column - column0) / d_column
                                                : infinity;
    const double exit_row = d_row > 0.0   ? (row + 1 - row0) / d_row
                            : d_row < 0.0 ? (row - row0) / d_row
                                          : infinity;
    enter = std::min(exit_column, exit_row);
    const double z = origin.z() + enter * direction.z();
    if (best.distance <= enter || enter == infinity || (direction.z() > 0.0 && z > highest_)) {
      break;
    }
    if (exit_column < exit_row) {
      column += d_column > 0.0 ? 1 : -1;
    } else {
      row += d_row > 0.0 ? 1 : -1;
    }
  }
  return best;
}

ReferenceEstimate ReferenceTracer::Texel(int x, int row, const Eigen::Vector3d& wo,
                                         const std::vector<Eigen::Vector3d>& lights, int bounces,
                                         int num_paths, uint64_t seed) const {
  Rng rng(seed);
  ReferenceEstimate estimate;
  estimate.mean.assign(lights.size(), {});
  estimate.standard_error.assign(lights.size(), {});
  for (int path = 0; path < num_paths; ++path) {
    std::vector<std::array<double, 3>> value(lights.size());
    const double px = x + rng.NextDouble();
    const double py = maps_.size - row - rng.NextDouble();
    const double rise = (highest_ + 1.0) / wo.z();
    Eigen::Vector3d origin(px + rise * wo.x(), py + rise * wo.y(), highest_ + 1.0);
    Eigen::Vector3d direction = -wo;
    std::array<double, 3> throughput{1.0, 1.0, 1.0};
    for (int vertex = 0; vertex <= bounces; ++vertex) {
      const ReferenceHit hit = Trace(origin, direction);
      if (!hit.found) {
        break;
      }
      const Eigen::Matrix3d frame = FrameOf(hit.normal);
      const Eigen::Vector3d out = frame.transpose() * -direction;
      const Eigen::Vector3d start = hit.point + kOffset * hit.normal;
      for (size_t l = 0; l < lights.size(); ++l) {
        const Eigen::Vector3d in = frame.transpose() * lights[l];
        if (in.z() <= 0.0 || Trace(start, lights[l]).found) {
          continue;
        }
        const double matte = LeftOver(in.z()) * LeftOver(out.z()) / average_left_over_;
        // The lobe takes part at the first vertex only (btf/meso/README.md).
        const double lobe = vertex == 0 ? LobeTimesPi(out, in, hit.roughness, maps_.specular_f0) : 0.0;
        for (int c = 0; c < 3; ++c) {
          value[l][c] += throughput[c] * in.z() * (hit.albedo[c] * matte + lobe);
        }
      }
      const double r = std::sqrt(rng.NextDouble());
      const double phi = 2.0 * kPi * rng.NextDouble();
      const Eigen::Vector3d in(r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0, 1.0 - r * r)));
      for (int c = 0; c < 3; ++c) {
        throughput[c] *= hit.albedo[c] * LeftOver(in.z()) * LeftOver(out.z()) / average_left_over_;
      }
      origin = start;
      direction = frame * in;
    }
    for (size_t l = 0; l < lights.size(); ++l) {
      for (int c = 0; c < 3; ++c) {
        estimate.mean[l][c] += value[l][c];
        estimate.standard_error[l][c] += value[l][c] * value[l][c];
      }
    }
  }
  for (size_t l = 0; l < lights.size(); ++l) {
    for (int c = 0; c < 3; ++c) {
      estimate.mean[l][c] /= num_paths;
      const double variance = std::max(
          0.0, estimate.standard_error[l][c] / num_paths - estimate.mean[l][c] * estimate.mean[l][c]);
      estimate.standard_error[l][c] = std::sqrt(variance / (num_paths - 1));
    }
  }
  return estimate;
}

}  // namespace tessera
