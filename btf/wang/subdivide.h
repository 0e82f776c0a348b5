// Conforming subdivision of quad meshes into quads of similar size.
//
// A chord is the strip of quads met by leaving each through the side opposite to the one it was entered by;
// all the edges it crosses must be split alike, so each chord has one count and the mesh stays conforming:
//
//      +-----+-----+--------+           the chord of edge a crosses every edge marked a; with a count of 2
//      a     a     a        a           each of its quads becomes 2 rows
//      +-----+-----+--------+
//
//   TESSERA_ASSIGN_OR_RETURN(QuadAdjacency adjacency, BuildAdjacency(mesh));
//   Chords chords = FindChords(adjacency);
//   std::vector<uint32_t> counts = ChordCounts(mesh, chords, /*target_quads=*/0);
//   QuadMesh fine = SubdivideQuads(mesh, adjacency, chords, counts);
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "btf/wang/quad_mesh.h"

namespace tessera {

// Meshes of fewer quads are subdivided to about this many when no target is given, so that a cube of six
// quads is not dressed with six tiles.
inline constexpr uint32_t kDefaultTargetQuads = 256;
// The built-in rule equalises sizes at no more than this many times the quads.
inline constexpr uint32_t kMaxDefaultGrowth = 4;

// The chord that crosses each side; sides k and k + 2 of a face have the same one.
struct Chords {
  uint32_t num_chords = 0;
  std::vector<std::array<uint32_t, 2>> of_face;  // [face][side mod 2], numbered in order of first appearance

  [[nodiscard]] uint32_t across(size_t face, int side) const { return of_face[face][side & 1]; }
};
[[nodiscard]] Chords FindChords(const QuadAdjacency& adjacency);

// Into how many parts each chord's edges are split, >= 1: the median edge of the chord over a length L,
// rounded so that the ratio of part and L is nearest to 1. With a target, L gives the number of quads nearest
// to it; without, L is the mesh's median edge, or what gives kDefaultTargetQuads if that is less, but not
// below what gives kMaxDefaultGrowth times the quads. Never more than kMaxMeshQuads quads.
[[nodiscard]] std::vector<uint32_t> ChordCounts(const QuadMesh& mesh, const Chords& chords,
                                                uint32_t target_quads);

// Number of quads after subdivision.
[[nodiscard]] uint64_t SubdividedQuads(const Chords& chords, const std::vector<uint32_t>& counts);

// Positions and normals are bilinear within each quad. Vertices of `mesh` keep their indices; then come the
// vertices on edges, in order of ListEdges, then those inside faces. The parts of a face follow each other
// row by row, each with its sides parallel to the face's, so a consistent frame stays consistent. Counts >=
// 1, one a chord.
[[nodiscard]] QuadMesh SubdivideQuads(const QuadMesh& mesh, const QuadAdjacency& adjacency,
                                      const Chords& chords, const std::vector<uint32_t>& counts);

}  // namespace tessera
