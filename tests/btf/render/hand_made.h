// Small dressings, tile sets and pictures' figures for the tests of rendering, made by hand.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "btf/base/rng.h"
#include "btf/codec/dsh/dsh_basis.h"
#include "btf/image/image.h"
#include "btf/render/reference.h"
#include "btf/wang/arrangement.h"
#include "btf/wang/dressing.h"
#include "btf/wang/tile_set.h"
#include "tests/btf/wang/turned_tiles.h"

namespace tessera::testing {

inline int Degree(int index) {
  return static_cast<int>(std::sqrt(static_cast<double>(index)));
}

// Bases of a codec: the identity; functions that mix degrees but keep their order m, as orthonormalising over
// the hemisphere does; anything invertible.
enum class BasisKind { kIdentity, kByOrder, kGeneral, kOrthonormal };

inline CodecTable Basis(int size, BasisKind kind) {
  CodecTable table{{size, size}, std::vector<float>(static_cast<size_t>(size) * size)};
  const auto order = [](int index) { return index - Degree(index) * (Degree(index) + 1); };
  for (int i = 0; i < size; ++i) {
    table.values[i * size + i] = 1.0f;
    for (int j = 0; j < i; ++j) {
      if (kind == BasisKind::kGeneral) {
        table.values[i * size + j] = 0.1f * std::sin(static_cast<float>(i + 3 * j));
      } else if (kind == BasisKind::kByOrder && order(i) == order(j)) {
        table.values[i * size + j] = 0.2f * std::sin(static_cast<float>(Degree(i) + 3 * Degree(j)));
      }
    }
  }
  return table;
}

// The basis of codec "dsh".
inline CodecTable OrthonormalBasis(int size, DshArgument argument, double max_theta_deg) {
  const Eigen::MatrixXf basis =
      OrthonormalDshBasis(size, argument, RadFromDeg(max_theta_deg)).transpose().cast<float>();
  return {{size, size}, std::vector<float>(basis.data(), basis.data() + basis.size())};
}

// Smooth reflectance between about 0 and 1 that differs from BTFel to BTFel and with every direction.
inline BtfelTable RandomBtfels(int count, int kl, int kv, uint64_t seed,
                               BasisKind basis = BasisKind::kIdentity) {
  BtfelTable table;
  table.codec_id = "dsh-cls";
  table.codec_version = 1;
  table.num_coefficients = 3 * kl * kv;
  table.parameters = {{"kl", kl}, {"kv", kv}};
  table.tables["basis_light"] = Basis(kl, basis);
  table.tables["basis_view"] = Basis(kv, basis);
  if (basis == BasisKind::kOrthonormal) {
    table.codec_id = "dsh";
    table.tables["basis_light"] = OrthonormalBasis(kl, DshArgument::kLight, 75.0);
    table.tables["basis_view"] = OrthonormalBasis(kv, DshArgument::kView, 70.0);
  }
  table.lights = {{0.0, 0.0}, {RadFromDeg(75.0), 0.0}};
  table.views = {{0.0, 0.0}, {RadFromDeg(70.0), 0.0}};
  for (int k = 0; k < table.num_coefficients; ++k) {
    const int i = k % kl;
    const int j = k / kl % kv;
    const bool is_mean = i == 0 && j == 0;
    const double reach = (is_mean ? 3.0 : 1.0) / (1.0 + std::pow(Degree(i) + Degree(j), 2.5));
    table.offset.push_back(static_cast<float>(is_mean ? 4.0 : -0.5 * reach));
    table.step.push_back(static_cast<float>(reach / 255.0));
  }
  Rng rng(seed);
  table.codes.resize(static_cast<size_t>(count) * table.num_coefficients);
  for (uint8_t& code : table.codes) {
    code = static_cast<uint8_t>(rng.NextBelow(256));
  }
  return table;
}

// value = cos(theta_light) whatever the view: albedo 1.
inline BtfelTable WhiteDiffuser() {
  BtfelTable table = RandomBtfels(1, 4, 1, 1);
  for (int k = 0; k < table.num_coefficients; ++k) {
    table.offset[k] = 0.0f;
    // y_0 of the view is sqrt(1 / 4 pi), y_2 of the light is sqrt(3 / 4 pi) cos(theta).
    table.step[k] = static_cast<float>(4.0 * kPi / std::sqrt(3.0));
    table.codes[k] = k % 4 == 2 ? 1 : 0;
  }
  return table;
}

// Tiles of random texels with random turns: no two borders match, so that nothing hides a wrong texel.
inline TileSet RandomTileSet(BtfelTable btfels, int tile_size, uint64_t seed,
                             std::string_view arrangement_id = "surface-96") {
  const Arrangement& arrangement = **FindArrangement(arrangement_id);
  TileSet tile_set;
  tile_set.arrangement_id = arrangement.id;
  tile_set.arrangement_sha256 = arrangement.sha256;
  tile_set.tile_size = tile_size;
  tile_set.strip_height = tile_size / 2;
  tile_set.tile_codes = arrangement.codes;
  tile_set.btfels = std::move(btfels);
  Rng rng(seed);
  tile_set.tile_index.resize(arrangement.codes.size() * tile_size * tile_size);
  for (uint32_t& texel : tile_set.tile_index) {
    texel = PackTexel(static_cast<uint32_t>(rng.NextBelow(tile_set.btfels.size())),
                      static_cast<int>(rng.NextBelow(4)));
  }
  return tile_set;
}

// A set of surface-26 as one of surface-96 that shows the same.
inline TileSet AsSurface96(TileSet tile_set) {
  const Arrangement& arrangement = **FindArrangement("surface-96");
  tile_set.arrangement_id = arrangement.id;
  tile_set.arrangement_sha256 = arrangement.sha256;
  tile_set.tile_codes = arrangement.codes;
  tile_set.tile_index = Surface96FromSurface26(tile_set.tile_index, tile_set.tile_size);
  return tile_set;
}

// The mesh as it is, with random tiles and turns.
inline Dressing RandomDressing(QuadMesh mesh, uint64_t seed) {
  const Arrangement& arrangement = **FindArrangement("surface-96");
  Dressing dressing;
  dressing.arrangement_id = arrangement.id;
  dressing.arrangement_sha256 = arrangement.sha256;
  Rng rng(seed);
  for (size_t i = 0; i < mesh.quads.size(); ++i) {
    dressing.tile.push_back(static_cast<uint32_t>(rng.NextBelow(arrangement.codes.size())));
    dressing.turns.push_back(static_cast<uint8_t>(rng.NextBelow(4)));
  }
  dressing.mesh = std::move(mesh);
  return dressing;
}

// n x n quads over [-1, 1]^2, vertices moved at random by `skew` of a quad's side in all three dimensions;
// faces start at random corners, so that their sides meet in every combination.
inline QuadMesh SkewedGrid(int n, double skew, uint64_t seed) {
  Rng rng(seed);
  const auto move = [&] { return skew * 2.0 / n * (2.0 * rng.NextDouble() - 1.0); };
  QuadMesh mesh;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      mesh.positions.emplace_back(2.0 * i / n - 1.0 + move(), 2.0 * j / n - 1.0 + move(), move());
      mesh.normals.push_back(
          Eigen::Vector3d(skew * (rng.NextDouble() - 0.5), skew * (rng.NextDouble() - 0.5), 1.0)
              .normalized()
              .cast<float>());
    }
  }
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const auto v = static_cast<uint32_t>(j * (n + 1) + i);
      const std::array<uint32_t, 4> corners = {v, v + 1, v + n + 2, v + n + 1};
      const auto first = skew > 0.0 ? rng.NextBelow(4) : 0;
      mesh.quads.push_back(
          {corners[first], corners[(first + 1) % 4], corners[(first + 2) % 4], corners[(first + 3) % 4]});
    }
  }
  return mesh;
}

// Above what single precision does to a value of about 1.
inline constexpr double kVisibleDifference = 1e-3;

struct Comparison {
  double rmse = 0.0;
  double worst = 0.0;
  double differing = 0.0;  // share of pixels with a component off by more than kVisibleDifference
  size_t pixels = 0;       // compared
};

// Whether the same lights reach all that is seen within `margin` pixels.
inline bool IsAwayFromShadows(const ReferencePicture& reference, int x, int y, int margin) {
  const int width = reference.image.width;
  const uint64_t lit = reference.lit_somewhere[static_cast<size_t>(y) * width + x];
  for (int j = std::max(y - margin, 0); j <= std::min(y + margin, reference.image.height - 1); ++j) {
    for (int i = std::max(x - margin, 0); i <= std::min(x + margin, width - 1); ++i) {
      const size_t pixel = static_cast<size_t>(j) * width + i;
      if (reference.lit_somewhere[pixel] != lit || reference.lit_everywhere[pixel] != lit) {
        return false;
      }
    }
  }
  return true;
}

// Over pixels whose neighbourhood of 3 x 3 is wholly covered without a jump in depth, and that no edge of a
// shadow comes nearer to than `shadow_margin` pixels.
inline Comparison CompareAwayFromSilhouettes(const Image& image, const ReferencePicture& reference,
                                             int shadow_margin = 0) {
  Comparison result;
  double squares = 0.0;
  const int width = image.width;
  for (int y = 1; y + 1 < image.height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      double nearest = 1e300;
      double farthest = 0.0;
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dx = -1; dx <= 1; ++dx) {
          const size_t pixel = static_cast<size_t>(y + dy) * width + x + dx;
          nearest = std::min(nearest, reference.nearest[pixel]);
          farthest = std::max(farthest, reference.farthest[pixel]);
        }
      }
      // A surface seen at 80 degrees from a few sizes away changes its depth by less over three pixels.
      if (!std::isfinite(farthest) || farthest - nearest > 0.06 * nearest) {
        continue;
      }
      if (shadow_margin > 0 && !IsAwayFromShadows(reference, x, y, shadow_margin)) {
        continue;
      }
      ++result.pixels;
      double largest = 0.0;
      for (int c = 0; c < 3; ++c) {
        const double difference = image.at(x, y)[c] - reference.image.at(x, y)[c];
        squares += difference * difference / 3.0;
        largest = std::max(largest, std::abs(difference));
      }
      result.worst = std::max(result.worst, largest);
      result.differing += largest > kVisibleDifference ? 1.0 : 0.0;
    }
  }
  result.differing /= static_cast<double>(std::max<size_t>(result.pixels, 1));
  result.rmse = std::sqrt(squares / static_cast<double>(std::max<size_t>(result.pixels, 1)));
  return result;
}

}  // namespace tessera::testing
