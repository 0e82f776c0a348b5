// Quad meshes that tests of several modules share.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "btf/base/rng.h"
#include "btf/wang/quad_mesh.h"

namespace tessera {

inline QuadMesh WithNormals(QuadMesh mesh) {
  mesh.normals = ComputeNormals(mesh);
  return mesh;
}

// The cube [0, 1]^3, counter-clockwise seen from outside.
inline QuadMesh Cube() {
  QuadMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.positions.push_back(Eigen::Vector3i(i & 1, (i >> 1) & 1, i >> 2).cast<float>());
  }
  mesh.quads = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  return WithNormals(std::move(mesh));
}

// A flat grid of columns x rows unit quads; as a band, the last column meets the first, after a half twist if
// asked for (columns >= 3).
enum class Closing { kOpen, kBand, kMoebius };
inline QuadMesh Strip(uint32_t columns, uint32_t rows, Closing closing) {
  QuadMesh mesh;
  const uint32_t stored = closing == Closing::kOpen ? columns + 1 : columns;
  for (uint32_t i = 0; i < stored; ++i) {
    for (uint32_t j = 0; j <= rows; ++j) {
      mesh.positions.push_back(
          Eigen::Vector3f(static_cast<float>(i), static_cast<float>(j), static_cast<float>(i * i) / 64.0f));
    }
  }
  const auto vertex = [&](uint32_t i, uint32_t j) {
    if (i < stored) {
      return i * (rows + 1) + j;
    }
    return closing == Closing::kMoebius ? rows - j : j;
  };
  for (uint32_t j = 0; j < rows; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      mesh.quads.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
    }
  }
  return WithNormals(std::move(mesh));
}

// The surface of a random heap of unit cubes in a 4^3 box, each vertex shared by all quads at its place, with
// every face's first vertex turned at random. Edges where only two cubes touch diagonally would have four
// faces; cubes are added until there are none.
inline QuadMesh RandomPolycube(uint64_t seed) {
  constexpr int kSize = 4;
  Rng rng(seed);
  std::vector<bool> cell(kSize * kSize * kSize);
  for (auto&& filled : cell) {
    filled = rng.NextBelow(100) < 45;
  }
  cell[0] = true;
  const auto filled = [&](const Eigen::Vector3i& at) {
    return (at.array() >= 0).all() && (at.array() < kSize).all() &&
           cell[(at.x() * kSize + at.y()) * kSize + at.z()];
  };
  for (bool changed = true; changed;) {
    changed = false;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3i s = Eigen::Vector3i::Unit((axis + 1) % 3);
      const Eigen::Vector3i t = Eigen::Vector3i::Unit((axis + 2) % 3);
      for (int i = 0; i < kSize * kSize * kSize; ++i) {
        const Eigen::Vector3i at(i / 16, i / 4 % 4, i % 4);
        const bool diagonal = filled(at) && filled(at + s + t) && !filled(at + s) && !filled(at + t);
        const bool other = !filled(at) && !filled(at + s + t) && filled(at + s) && filled(at + t);
        if (diagonal || other) {
          const Eigen::Vector3i fill = diagonal ? Eigen::Vector3i(at + s) : at;
          cell[(fill.x() * kSize + fill.y()) * kSize + fill.z()] = true;
          changed = true;
        }
      }
    }
  }
  QuadMesh mesh;
  std::vector<int> index((kSize + 1) * (kSize + 1) * (kSize + 1), -1);
  const auto vertex = [&](const Eigen::Vector3i& at) {
    int& found = index[(at.x() * (kSize + 1) + at.y()) * (kSize + 1) + at.z()];
    if (found < 0) {
      found = static_cast<int>(mesh.positions.size());
      mesh.positions.push_back(at.cast<float>());
    }
    return static_cast<uint32_t>(found);
  };
  for (int i = 0; i < kSize * kSize * kSize; ++i) {
    const Eigen::Vector3i at(i / 16, i / 4 % 4, i % 4);
    for (int axis = 0; filled(at) && axis < 3; ++axis) {
      const Eigen::Vector3i n = Eigen::Vector3i::Unit(axis);
      const Eigen::Vector3i s = Eigen::Vector3i::Unit((axis + 1) % 3);
      const Eigen::Vector3i t = Eigen::Vector3i::Unit((axis + 2) % 3);
      for (const bool far_side : {true, false}) {
        if (filled(far_side ? Eigen::Vector3i(at + n) : Eigen::Vector3i(at - n))) {
          continue;
        }
        const Eigen::Vector3i corner = far_side ? Eigen::Vector3i(at + n) : at;
        const std::array<uint32_t, 4> around{vertex(corner), vertex(corner + (far_side ? s : t)),
                                             vertex(corner + s + t), vertex(corner + (far_side ? t : s))};
        const auto turn = static_cast<uint32_t>(rng.NextBelow(4));
        mesh.quads.push_back(
            {around[turn], around[(turn + 1) & 3], around[(turn + 2) & 3], around[(turn + 3) & 3]});
      }
    }
  }
  return WithNormals(std::move(mesh));
}

}  // namespace tessera
