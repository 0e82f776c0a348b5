#include "btf/render/surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <absl/strings/str_cat.h>
#include <Eigen/Geometry>

#include "btf/base/status_macros.h"
#include "btf/math/conventions.h"

namespace tessera {
namespace {

// Distances to sides are floored here: 1e-6 of a side is far below a texel, and keeps 1 / distance finite.
constexpr double kLeastSideDistance = 1e-6;
// Squared length below which a vector has no direction worth keeping.
constexpr double kNoDirection = 1e-24;

template <typename V>
V Bilinear(const V& v0, const V& v1, const V& v2, const V& v3, double s, double q) {
  return (1.0 - q) * ((1.0 - s) * v0 + s * v1) + q * ((1.0 - s) * v3 + s * v2);
}

// A unit vector perpendicular to n.
Eigen::Vector3d AnyPerpendicular(const Eigen::Vector3d& n) {
  const Eigen::Vector3d axis =
      std::abs(n.x()) < 0.6 ? Eigen::Vector3d::UnitX().eval() : Eigen::Vector3d::UnitY().eval();
  return axis.cross(n).normalized();
}

Eigen::Vector3d NormalizedOr(const Eigen::Vector3d& v, const Eigen::Vector3d& otherwise) {
  const double squared = v.squaredNorm();
  return squared > kNoDirection ? Eigen::Vector3d(v / std::sqrt(squared)) : otherwise;
}

// v turned by `turns` quarter turns counter-clockwise about n, for v perpendicular to n.
Eigen::Vector3d Turned(const Eigen::Vector3d& v, const Eigen::Vector3d& n, int turns) {
  switch (turns & 3) {
    case 0:
      return v;
    case 1:
      return n.cross(v);
    case 2:
      return -v;
    default:
      return -n.cross(v);
  }
}

// (u, v) of the tile from (s, q) of the face.
Eigen::Vector2d TileFromFace(double s, double q, int turns) {
  for (int i = 0; i < (turns & 3); ++i) {
    const double old_s = s;
    s = q;
    q = 1.0 - old_s;
  }
  return {s, q};
}

absl::Status CheckMips(const TileSet& tile_set, const TileMips& mips) {
  for (size_t i = 0; i < mips.levels.size(); ++i) {
    const MipLevel& level = mips.levels[i];
    const int side = level.tile_size;
    const size_t parts = tile_set.tile_codes.size() * side * side * mips.parts_per_texel;
    if (side < 1 || side << (i + 1) != tile_set.tile_size || level.parts.size() != parts ||
        level.btfels.num_coefficients != tile_set.btfels.num_coefficients) {
      return absl::InvalidArgumentError(
          absl::StrCat("mip level ", i + 1, ": ", level.parts.size(), " parts in tiles of ", side, "x", side,
                       " texels do not go with ", tile_set.tile_codes.size(), " tiles of ",
                       tile_set.tile_size, "x", tile_set.tile_size));
    }
    for (const MipPart& part : level.parts) {
      if (part.weight > 0.0F && BtfelOfTexel(part.texel) >= level.btfels.size()) {
        return absl::InvalidArgumentError(absl::StrCat(
            "mip level ", i + 1, " names BTFel ", BtfelOfTexel(part.texel), " of ", level.btfels.size()));
      }
    }
  }
  return absl::OkStatus();
}

Eigen::Vector3d LocalView(const SurfaceFrame& frame, const Eigen::Vector3d& to_eye) {
  Eigen::Vector3d view = frame.LocalFromWorld(to_eye);
  if (view.z() < kLeastViewCosine) {
    view.z() = kLeastViewCosine;
    view.normalize();
  }
  return view;
}

}  // namespace

absl::StatusOr<DressedSurface> DressedSurface::Create(const Dressing& dressing, const TileSet& tile_set,
                                                      const TileMips* mips) {
  const QuadMesh& mesh = dressing.mesh;
  if (mesh.normals.size() != mesh.positions.size()) {
    return absl::InvalidArgumentError(absl::StrCat("the dressing has ", mesh.positions.size(),
                                                   " positions but ", mesh.normals.size(), " normals"));
  }
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    if (!mesh.positions[i].allFinite() || !mesh.normals[i].allFinite()) {
      return absl::InvalidArgumentError(absl::StrCat("vertex ", i, " of the dressing is not finite"));
    }
  }
  for (size_t f = 0; f < mesh.quads.size(); ++f) {
    for (const uint32_t vertex : mesh.quads[f]) {
      if (vertex >= mesh.positions.size()) {
        return absl::InvalidArgumentError(
            absl::StrCat("quad ", f, " names vertex ", vertex, " of ", mesh.positions.size()));
      }
    }
  }
  DressedSurface surface;
  TESSERA_ASSIGN_OR_RETURN(surface.binding_, Redress(dressing, tile_set));
  TESSERA_ASSIGN_OR_RETURN(surface.neighbours_, BuildTileNeighbours(dressing));
  const size_t num_btfels = tile_set.btfels.size();
  for (size_t i = 0; i < tile_set.tile_index.size(); ++i) {
    if (BtfelOfTexel(tile_set.tile_index[i]) >= num_btfels) {
      return absl::InvalidArgumentError(absl::StrCat("texel ", i, " of the tile set names BTFel ",
                                                     BtfelOfTexel(tile_set.tile_index[i]), " of ",
                                                     num_btfels));
    }
  }
  if (mips != nullptr) {
    TESSERA_RETURN_IF_ERROR(CheckMips(tile_set, *mips));
    surface.mips_ = mips;
  }
  return surface;
}

Eigen::Vector3d DressedSurface::PositionAt(const SurfacePoint& point) const {
  const QuadMesh& mesh = binding_.dressing->mesh;
  const Quad& quad = mesh.quads[point.face];
  const auto corner = [&](int k) -> Eigen::Vector3d { return mesh.positions[quad[k]].cast<double>(); };
  return Bilinear(corner(0), corner(1), corner(2), corner(3), point.s, point.q);
}

Eigen::Matrix<double, 3, 2> DressedSurface::TangentsAt(const SurfacePoint& point) const {
  const QuadMesh& mesh = binding_.dressing->mesh;
  const Quad& quad = mesh.quads[point.face];
  const auto corner = [&](int k) -> Eigen::Vector3d { return mesh.positions[quad[k]].cast<double>(); };
  Eigen::Matrix<double, 3, 2> tangents;
  tangents.col(0) = (1.0 - point.q) * (corner(1) - corner(0)) + point.q * (corner(2) - corner(3));
  tangents.col(1) = (1.0 - point.s) * (corner(3) - corner(0)) + point.s * (corner(2) - corner(1));
  return tangents;
}

SurfaceFrame DressedSurface::FrameAt(const SurfacePoint& point) const {
  const QuadMesh& mesh = binding_.dressing->mesh;
  const Quad& quad = mesh.quads[point.face];
  std::array<Eigen::Vector3d, 4> corner;
  std::array<Eigen::Vector3d, 4> normal;
  for (int k = 0; k < 4; ++k) {
    corner[k] = mesh.positions[quad[k]].cast<double>();
    normal[k] = mesh.normals[quad[k]].cast<double>();
  }
  SurfaceFrame frame;
  frame.position = Bilinear(corner[0], corner[1], corner[2], corner[3], point.s, point.q);
  const Eigen::Vector3d flat =
      NormalizedOr((corner[2] - corner[0]).cross(corner[3] - corner[1]), Eigen::Vector3d::UnitZ());
  frame.n = NormalizedOr(Bilinear(normal[0], normal[1], normal[2], normal[3], point.s, point.q), flat);

  const std::array<double, 4> distance = {point.q, 1.0 - point.s, 1.0 - point.q, point.s};
  std::array<Eigen::Vector3d, 4> proposal;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector3d edge = corner[(k + 1) & 3] - corner[k];
    const Eigen::Vector3d along = NormalizedOr(edge - edge.dot(frame.n) * frame.n, AnyPerpendicular(frame.n));
    proposal[k] = Turned(along, frame.n, -k);
    mean += proposal[k];
  }
  // Angles are measured from the mean, so that they do not wrap while the proposals agree within a half turn.
  mean = NormalizedOr(mean, proposal[0]);
  const Eigen::Vector3d mean_b = frame.n.cross(mean);
  double angle_rad = 0.0;
  double total = 0.0;
  for (int k = 0; k < 4; ++k) {
    const double weight = 1.0 / std::max(distance[k], kLeastSideDistance);
    angle_rad += weight * std::atan2(proposal[k].dot(mean_b), proposal[k].dot(mean));
    total += weight;
  }
  angle_rad /= total;
  const Eigen::Vector3d face_t = std::cos(angle_rad) * mean + std::sin(angle_rad) * mean_b;
  frame.t = Turned(face_t, frame.n, binding_.dressing->turns[point.face]);
  frame.b = frame.n.cross(frame.t);
  return frame;
}

DressedSurface::Texel DressedSurface::TexelAt(int face, int x, int y, int w) const {
  int side = -1;
  int position = 0;
  if (y >= w) {
    side = 0;
    position = x;
  } else if (x >= w) {
    side = 1;
    position = w - 1 - y;
  } else if (y < 0) {
    side = 2;
    position = w - 1 - x;
  } else if (x < 0) {
    side = 3;
    position = y;
  }
  int turns = 0;
  if (side >= 0) {
    const TileNeighbour& across = neighbours_[face][side];
    if (across.face >= 0) {
      face = across.face;
      turns = across.turns;
      const TexelPosition texel = TexelOnSide(across.side, w - 1 - position, 0, w);
      x = texel.x;
      y = texel.y;
    } else {
      x = std::clamp(x, 0, w - 1);
      y = std::clamp(y, 0, w - 1);
    }
  }
  return {.face = face, .x = x, .y = y, .turns = turns};
}

std::array<DressedSurface::Texel, 4> DressedSurface::BilinearTexels(const SurfacePoint& point, int w) const {
  const Eigen::Vector2d uv = TileFromFace(point.s, point.q, binding_.dressing->turns[point.face]);
  const double x = std::clamp(uv.x(), 0.0, 1.0) * w - 0.5;
  const double y = (1.0 - std::clamp(uv.y(), 0.0, 1.0)) * w - 0.5;
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const double fx = x - x0;
  const double fy = y - y0;
  const bool crosses_x = x0 < 0 || x0 + 1 >= w;
  const bool crosses_y = y0 < 0 || y0 + 1 >= w;
  const auto texel = [&](int tx, int ty, double weight) {
    Texel result = TexelAt(point.face, tx, ty, w);
    result.weight = weight;
    return result;
  };
  if (crosses_x && crosses_y) {
    const int own_x = x0 < 0 ? 0 : w - 1;
    const int own_y = y0 < 0 ? 0 : w - 1;
    const double p = x0 < 0 ? 1.0 - fx : fx;
    const double q = y0 < 0 ? 1.0 - fy : fy;
    const double share_x = p * (0.5 - q);
    const double share_y = q * (0.5 - p);
    const double h = share_x + share_y > 0.0 ? share_x / (share_x + share_y) : 0.5;
    const double across_x = p * h;
    const double across_y = q * (1.0 - h);
    return {texel(own_x, own_y, 1.0 - across_x - across_y), texel(x0 < 0 ? -1 : w, own_y, across_x),
            texel(own_x, y0 < 0 ? -1 : w, across_y), texel(own_x, own_y, 0.0)};
  }
  return {texel(x0, y0, (1.0 - fx) * (1.0 - fy)), texel(x0 + 1, y0, fx * (1.0 - fy)),
          texel(x0, y0 + 1, (1.0 - fx) * fy), texel(x0 + 1, y0 + 1, fx * fy)};
}

Tap DressedSurface::TapOf(const Texel& texel) const {
  const uint32_t entry =
      binding_.texels[texel.face][static_cast<size_t>(texel.y) * binding_.tile_size + texel.x];
  return {
      .btfel = BtfelOfTexel(entry), .turns = (TurnsOfTexel(entry) + texel.turns) & 3, .weight = texel.weight};
}

Taps DressedSurface::BilinearTaps(const SurfacePoint& point) const {
  Taps taps;
  std::ranges::transform(BilinearTexels(point, binding_.tile_size), taps.begin(),
                         [this](const Texel& texel) { return TapOf(texel); });
  return taps;
}

void DressedSurface::AppendMipTaps(const SurfacePoint& point, int level, double weight,
                                   std::vector<Tap>& taps) const {
  const MipLevel& mip = mips_->levels[level - 1];
  for (const Texel& texel : BilinearTexels(point, mip.tile_size)) {
    const int tile = static_cast<int>(binding_.dressing->tile[texel.face]);
    for (const MipPart& part : mip.texel(mips_->parts_per_texel, tile, texel.x, texel.y)) {
      taps.push_back({.level = level,
                      .btfel = BtfelOfTexel(part.texel),
                      .turns = (TurnsOfTexel(part.texel) + texel.turns) & 3,
                      .weight = weight * texel.weight * part.weight});
    }
  }
}

std::vector<Tap> DressedSurface::MipTaps(const SurfacePoint& point, double level) const {
  const double clamped = std::clamp(level, 0.0, static_cast<double>(num_mip_levels()));
  const int below = static_cast<int>(clamped);
  const double share_above = clamped - below;
  std::vector<Tap> taps;
  if (below == 0) {
    for (Tap tap : BilinearTaps(point)) {
      tap.weight *= 1.0 - share_above;
      taps.push_back(tap);
    }
  } else {
    AppendMipTaps(point, below, 1.0 - share_above, taps);
  }
  if (share_above > 0.0) {
    AppendMipTaps(point, below + 1, share_above, taps);
  }
  return taps;
}

Tap DressedSurface::NearestTap(const SurfacePoint& point) const {
  const int w = binding_.tile_size;
  const Eigen::Vector2d uv = TileFromFace(point.s, point.q, binding_.dressing->turns[point.face]);
  const int x = std::clamp(static_cast<int>(std::floor(uv.x() * w + kNearestShiftTexels)), 0, w - 1);
  const int y = std::clamp(static_cast<int>(std::floor((1.0 - uv.y()) * w + kNearestShiftTexels)), 0, w - 1);
  return TapOf(TexelAt(point.face, x, y, w));
}

BlendedTaps::BlendedTaps(const DressedSurface& surface, std::span<const Tap> taps) {
  for (const Tap& tap : taps) {
    if (tap.weight > 0.0) {
      const BtfelTable& table = surface.btfels(tap.level);
      const std::span<const uint8_t> codes = table.btfel(tap.btfel);
      std::vector<double>& sum = coefficients_[tap.turns];
      sum.resize(codes.size(), 0.0);
      for (size_t i = 0; i < codes.size(); ++i) {
        sum[i] += tap.weight *
                  (static_cast<double>(table.offset[i]) + static_cast<double>(table.step[i]) * codes[i]);
      }
    }
  }
}

Eigen::Array3d BlendedTaps::ValueOf(const std::function<LinearForm(int turns)>& form_of) const {
  Eigen::Array3d sum = Eigen::Array3d::Zero();
  for (int turns = 0; turns < 4; ++turns) {
    if (!coefficients_[turns].empty()) {
      sum += form_of(turns).ValueOf(coefficients_[turns]);
    }
  }
  return sum;
}

Eigen::Array3d ReflectanceOfTaps(const BlendedTaps& taps, const Decoder& decoder, const SurfaceFrame& frame,
                                 const Eigen::Vector3d& to_light, const Eigen::Vector3d& to_eye) {
  const Eigen::Vector3d light = frame.LocalFromWorld(to_light);
  const Eigen::Vector3d view = LocalView(frame, to_eye);
  return taps.ValueOf([&](int turns) {
    return decoder.Form(UnturnedFromTurned(light, turns), UnturnedFromTurned(view, turns));
  });
}

Eigen::Array3d RadianceOfTaps(const BlendedTaps& taps, const Decoder& decoder, const SurfaceFrame& frame,
                              const FrequencyLight& light, const Eigen::Vector3d& to_eye) {
  Eigen::Matrix3d local_from_world;
  local_from_world << frame.t.transpose(), frame.b.transpose(), frame.n.transpose();
  const Eigen::MatrixXd in_frame = light.InFrame(local_from_world);
  const Eigen::Vector3d view = LocalView(frame, to_eye);
  return taps.ValueOf([&](int turns) { return RadianceForm(decoder, view, in_frame, turns); });
}

}  // namespace tessera
