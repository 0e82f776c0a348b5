// Moves the vertices of a quad mesh over a surface until its quads are about square and of similar size.
//
//   QuadRelaxer relaxer(surface, std::move(positions), quads, context);
//   TESSERA_RETURN_IF_ERROR(relaxer.Attach(3));
//   relaxer.Cover(std::move(samples));
//   TESSERA_RETURN_IF_ERROR(relaxer.Relax("relax", 200));
//   relaxer.SnapToCreases(creases);
//   TESSERA_RETURN_IF_ERROR(relaxer.Repair(0.7));
//
// Each quad asks for the square nearest to it, of a side between its own and the mesh's; a vertex goes to the
// mean of what its quads ask for, moved so that the mesh comes nearer to samples of the surface that it
// misses, and from there to the closest point of the surface. Vertices on the surface alone leave out rims
// and tips between them. Whatever is left with a bad corner is repaired by trying places around its vertices.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/base/run_context.h"
#include "btf/remesh/closest_point.h"
#include "btf/remesh/creases.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

// What is wrong with a quad.
struct QuadShape {
  std::array<double, 4>
      angles_rad{};  // of the corners seen from outside, -pi..pi; a folded one is not in 0..pi
  double area = 0.0;
  bool flipped = false;  // faces against the surface, or has a corner that turns against its own normal
};

struct SurfaceSample {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  // outward, unit
};

class QuadRelaxer {
 public:
  // Borrows all but the positions. `quads` is a closed oriented manifold.
  QuadRelaxer(const ClosestPoint& surface, std::vector<Eigen::Vector3d> positions,
              std::span<const Quad> quads, const RunContext& context);

  // Draws the mesh from about the surface onto it in so many steps, smoothing in each. Errors: CANCELLED.
  [[nodiscard]] absl::Status Attach(int num_steps);
  // What Relax keeps the mesh near to, from then on: points all over the surface. None at first.
  void Cover(std::vector<SurfaceSample> samples) { samples_ = std::move(samples); }
  // Steps towards squares; where one would flip quads that were not, vertices stay. Errors: CANCELLED.
  [[nodiscard]] absl::Status Relax(std::string_view stage, int num_steps);
  // Moves vertices onto creases and their corners where that leaves every quad in shape; they stay on them.
  // Returns how many there are.
  size_t SnapToCreases(const Creases& creases);
  // Tries places around the vertices of quads that are flipped or have a corner further than
  // `least_deviation_rad` from a right angle. Errors: CANCELLED.
  [[nodiscard]] absl::Status Repair(double least_deviation_rad);
  [[nodiscard]] size_t CountFlipped() const;

  [[nodiscard]] const std::vector<Eigen::Vector3d>& positions() const { return positions_; }
  [[nodiscard]] QuadShape ShapeOf(size_t quad) const;
  // Outward normal of the surface at the vertex.
  [[nodiscard]] Eigen::Vector3d SurfaceNormal(size_t vertex) const { return surface_.normals()[at_[vertex]]; }

 private:
  enum class Hold : uint8_t { kSurface, kCrease, kCorner };

  [[nodiscard]] std::span<const uint32_t> CornersAt(size_t vertex) const {
    return std::span(corners_).subspan(first_corner_[vertex],
                                       first_corner_[vertex + 1] - first_corner_[vertex]);
  }
  // Outward unit normal of the mesh at the vertex.
  [[nodiscard]] Eigen::Vector3d MeshNormal(size_t vertex) const;
  [[nodiscard]] double MeanSide() const;
  // What a vertex may be moved to from near `p`: a point of the surface or the crease it is held by.
  [[nodiscard]] SurfacePoint Allowed(size_t vertex, const Eigen::Vector3d& p) const;
  // Badness of the quads about the vertex.
  [[nodiscard]] double Energy(size_t vertex) const;
  [[nodiscard]] double WorstDeviation(size_t vertex) const;
  void Place(size_t vertex, const SurfacePoint& at);
  // From the mesh to the samples, for each vertex: the mean over those whose closest quads it is a corner of,
  // weighted by how near it is and by how far they are.
  [[nodiscard]] absl::StatusOr<std::vector<Eigen::Vector3d>> FindMisses() const;

  const ClosestPoint& surface_;
  std::vector<Eigen::Vector3d> positions_;
  std::span<const Quad> quads_;
  const RunContext& context_;
  const Creases* creases_ = nullptr;
  std::vector<uint32_t> first_corner_;  // [vertex], into corners_
  std::vector<uint32_t> corners_;       // 4 quad + corner
  std::vector<uint32_t> at_;            // [vertex] triangle of the surface
  std::vector<Hold> hold_;
  std::vector<SurfaceSample> samples_;
  double mean_side_ = 0.0;
};

}  // namespace tessera
