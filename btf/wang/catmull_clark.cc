#include "btf/wang/catmull_clark.h"

#include "btf/wang/mesh_topology.h"

namespace tessera {

QuadMesh CatmullClark(const QuadMesh& mesh, const QuadAdjacency& adjacency) {
  const MeshEdges edges = ListEdges(adjacency);
  const size_t num_vertices = mesh.positions.size();
  const size_t num_edges = edges.keys.size();
  const size_t num_faces = mesh.quads.size();
  const auto position = [&](uint32_t vertex) -> Eigen::Vector3d {
    return mesh.positions[vertex].cast<double>();
  };

  std::vector<Eigen::Vector3d> face_points(num_faces, Eigen::Vector3d::Zero());
  for (size_t face = 0; face < num_faces; ++face) {
    for (const uint32_t vertex : mesh.quads[face]) {
      face_points[face] += 0.25 * position(vertex);
    }
  }
  std::vector<Eigen::Vector3d> edge_points(num_edges);
  std::vector<Eigen::Vector3d> face_sum(num_vertices, Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> midpoint_sum(num_vertices, Eigen::Vector3d::Zero());
  std::vector<uint32_t> valence(num_vertices, 0);
  for (size_t edge = 0; edge < num_edges; ++edge) {
    const uint32_t face = edges.keys[edge] / 4;
    const uint32_t side = edges.keys[edge] % 4;
    const uint32_t a = mesh.quads[face][side];
    const uint32_t b = mesh.quads[face][(side + 1) & 3];
    const Eigen::Vector3d ends = position(a) + position(b);
    edge_points[edge] = 0.25 * (ends + face_points[face] + face_points[adjacency.across[face][side].face]);
    for (const uint32_t vertex : {a, b}) {
      midpoint_sum[vertex] += 0.5 * ends;
      ++valence[vertex];
    }
  }
  for (size_t face = 0; face < num_faces; ++face) {
    for (const uint32_t vertex : mesh.quads[face]) {
      face_sum[vertex] += face_points[face];
    }
  }

  QuadMesh fine;
  fine.positions.reserve(num_vertices + num_edges + num_faces);
  for (uint32_t v = 0; v < num_vertices; ++v) {
    const double n = valence[v];
    fine.positions.push_back(
        ((face_sum[v] / n + 2.0 * midpoint_sum[v] / n + (n - 3.0) * position(v)) / n).cast<float>());
  }
  for (const Eigen::Vector3d& point : edge_points) {
    fine.positions.push_back(point.cast<float>());
  }
  for (const Eigen::Vector3d& point : face_points) {
    fine.positions.push_back(point.cast<float>());
  }
  fine.quads.reserve(4 * num_faces);
  for (size_t face = 0; face < num_faces; ++face) {
    for (int k = 0; k < 4; ++k) {
      const auto first_edge = static_cast<uint32_t>(num_vertices);
      fine.quads.push_back({mesh.quads[face][k], first_edge + edges.edge_of[face][k],
                            static_cast<uint32_t>(num_vertices + num_edges + face),
                            first_edge + edges.edge_of[face][(k + 3) & 3]});
    }
  }
  fine.normals = ComputeNormals(fine);
  return fine;
}

}  // namespace tessera
