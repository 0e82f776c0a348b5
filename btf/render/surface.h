// The dressed surface: where a point of a face lies, how its local frame looks and which texels it shows.
// Reference semantics in double precision; the shaders of preview_shaders.cc say the same in GLSL.
//
//            side 2                A point of a face is (s, q) in [0, 1]^2, bilinear in its vertices: s along
//        3 +--------+ 2            side 0, q from side 0 to side 2. Dressing turn r maps it to the tile's
//   side 3 |        | side 1       (u, v) by (s, q) -> (q, 1 - s), r times, and turns (t, b) with it.
//        0 +--------+ 1            Texel (x, y), row 0 on top, has its centre at u = (x + 0.5) / w,
//            side 0                v = 1 - (y + 0.5) / w.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include <absl/status/statusor.h>
#include <Eigen/Core>

#include "btf/codec/decoder.h"
#include "btf/light/frequency_light.h"
#include "btf/mips/tile_mips.h"
#include "btf/wang/dressing.h"
#include "btf/wang/neighbour.h"
#include "btf/wang/redress.h"
#include "btf/wang/tile_set.h"

namespace tessera {

struct SurfacePoint {
  int face = 0;
  double s = 0.0;
  double q = 0.0;
};

// A right-handed orthonormal frame; t and b follow the columns and rows of the tile.
struct SurfaceFrame {
  Eigen::Vector3d position;
  Eigen::Vector3d t;
  Eigen::Vector3d b;
  Eigen::Vector3d n;  // the interpolated normal

  [[nodiscard]] Eigen::Vector3d LocalFromWorld(const Eigen::Vector3d& d) const {
    return {d.dot(t), d.dot(b), d.dot(n)};
  }
};

// One texel of a filter's footprint, or one part of it.
struct Tap {
  int level = 0;  // 0: of the tile set itself, else of its mip level
  uint32_t btfel = 0;
  int turns = 0;        // of the BTFel as the frame of the point sees it: its own and its tile's
  double weight = 0.0;  // 0: not read
};
using Taps = std::array<Tap, 4>;  // weights sum to 1

// A visible point whose interpolated normal turns away from the eye (coarse meshes, near silhouettes) is
// decoded as if seen at this cosine, so that outlines are not lined with black.
inline constexpr double kLeastViewCosine = 1e-3;

// Symmetric views put samples exactly on the borders of texels, where rounding would choose the texel. This
// breaks such ties the same way everywhere, and is far from the fractions that pixels and texels form.
inline constexpr double kNearestShiftTexels = 0.0037;

// Immutable, safe to share between threads. Borrows the dressing, the tile set and its mip levels.
class DressedSurface {
 public:
  // `mips` are those of `tile_set`, or none. Errors: those of Redress and BuildTileNeighbours;
  // INVALID_ARGUMENT naming the vertex that is not finite or does not exist, the texel whose BTFel does not
  // exist, or the mip level that does not go with the tile set.
  [[nodiscard]] static absl::StatusOr<DressedSurface> Create(const Dressing& dressing,
                                                             const TileSet& tile_set,
                                                             const TileMips* mips = nullptr);

  [[nodiscard]] Eigen::Vector3d PositionAt(const SurfacePoint& point) const;
  // Columns: how the position changes with s and with q.
  [[nodiscard]] Eigen::Matrix<double, 3, 2> TangentsAt(const SurfacePoint& point) const;

  // Each side proposes a frame from its own edge, projected perpendicular to the interpolated normal and
  // turned by its side number; the four angles are blended with weights 1 / distance to the side. On a side
  // only that side counts, so both faces there have the same frame up to quarter turns.
  [[nodiscard]] SurfaceFrame FrameAt(const SurfacePoint& point) const;

  // Bilinear footprint. Texels beyond a side are those of the face across it; beyond an open boundary the
  // border texel repeats. Beyond a vertex nothing is read: where both coordinates cross a side, with weights
  // p and q in [0, 1/2], the texel across the one counts p h and the texel across the other q (1 - h) with
  //   h = p (1/2 - q) / (p (1/2 - q) + q (1/2 - p)),
  // so that on either side (p or q = 1/2) both faces read the same two texels with the same weights.
  [[nodiscard]] Taps BilinearTaps(const SurfacePoint& point) const;

  // Bilinear footprints of the mip levels below and above `level` in [0, number of levels], blended; their
  // texels lie at the same places of coarser tiles, and their neighbours across sides and vertices are found
  // in the same way.
  [[nodiscard]] std::vector<Tap> MipTaps(const SurfacePoint& point, double level) const;

  // The texel that the point, moved by kNearestShiftTexels along the tile's columns and rows, lies in.
  [[nodiscard]] Tap NearestTap(const SurfacePoint& point) const;

  [[nodiscard]] const Dressing& dressing() const { return *binding_.dressing; }
  [[nodiscard]] const TileSet& tile_set() const { return *binding_.tile_set; }
  [[nodiscard]] const std::vector<std::array<TileNeighbour, 4>>& neighbours() const { return neighbours_; }
  [[nodiscard]] int num_mip_levels() const {
    return mips_ == nullptr ? 0 : static_cast<int>(mips_->levels.size());
  }
  // What the taps of a level name.
  [[nodiscard]] const BtfelTable& btfels(int level) const {
    return level == 0 ? tile_set().btfels : mips_->levels[level - 1].btfels;
  }

 private:
  // A texel of a face's tile at some level, as seen from a face, perhaps across a side.
  struct Texel {
    int face = 0;
    int x = 0;
    int y = 0;
    int turns = 0;  // of the face's tile, as the other sees it
    double weight = 1.0;
  };

  DressedSurface() = default;
  // One step beyond a side of the tile, w texels wide, is allowed.
  [[nodiscard]] Texel TexelAt(int face, int x, int y, int w) const;
  [[nodiscard]] std::array<Texel, 4> BilinearTexels(const SurfacePoint& point, int w) const;
  [[nodiscard]] Tap TapOf(const Texel& texel) const;
  void AppendMipTaps(const SurfacePoint& point, int level, double weight, std::vector<Tap>& taps) const;

  Binding binding_;
  const TileMips* mips_ = nullptr;
  std::vector<std::array<TileNeighbour, 4>> neighbours_;  // [face][tile side]
};

// The taps' BTFels, blended by their weights apart for each number of quarter turns: what they show under any
// light is linear in these.
class BlendedTaps {
 public:
  BlendedTaps(const DressedSurface& surface, std::span<const Tap> taps);

  // Values before the clamp at 0; `form_of` makes the form of BTFels of some turns.
  [[nodiscard]] Eigen::Array3d ValueOf(const std::function<LinearForm(int turns)>& form_of) const;

 private:
  std::array<std::vector<double>, 4> coefficients_;  // empty where no tap has these turns
};

// Reflectance, before the clamp at 0, of the taps in `frame` under unit world directions; a view
// below the horizon is lifted to kLeastViewCosine.
[[nodiscard]] Eigen::Array3d ReflectanceOfTaps(const BlendedTaps& taps, const Decoder& decoder,
                                               const SurfaceFrame& frame, const Eigen::Vector3d& to_light,
                                               const Eigen::Vector3d& to_eye);

// Radiance, before the clamp at 0, of the taps under light from all around, as RadianceForm has it; the
// view as above.
[[nodiscard]] Eigen::Array3d RadianceOfTaps(const BlendedTaps& taps, const Decoder& decoder,
                                            const SurfaceFrame& frame, const FrequencyLight& light,
                                            const Eigen::Vector3d& to_eye);

}  // namespace tessera
