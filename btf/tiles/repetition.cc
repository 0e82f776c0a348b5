#include "btf/tiles/repetition.h"

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <vector>

#include "btf/base/status_macros.h"
#include "btf/tiles/autocorrelation.h"
#include "btf/tiles/regularity.h"
#include "btf/tiles/tile_sides.h"
#include "btf/wang/dress.h"

namespace tessera {
namespace {

constexpr int kTilesAcross = 16;
constexpr int kLargestSide = 1024;  // of a plane that is not averaged down

absl::StatusOr<PointField> FieldOfPlane(const Exemplar& exemplar, const Arrangement& arrangement,
                                        const IndexMaps& maps, const RunContext& context) {
  QuadMesh mesh;
  const auto vertex = [](int i, int j) { return static_cast<uint32_t>(j * (kTilesAcross + 1) + i); };
  for (int j = 0; j <= kTilesAcross; ++j) {
    for (int i = 0; i <= kTilesAcross; ++i) {
      mesh.positions.emplace_back(static_cast<float>(i), static_cast<float>(j), 0.0f);
      mesh.normals.emplace_back(0.0f, 0.0f, 1.0f);
      if (i < kTilesAcross && j < kTilesAcross) {
        mesh.quads.push_back({vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
      }
    }
  }
  RunContext quiet = context;
  quiet.progress = nullptr;
  TESSERA_ASSIGN_OR_RETURN(
      const DressResult dressed,
      DressMesh(mesh, arrangement, {.target_quads = static_cast<uint32_t>(mesh.quads.size())}, quiet));
  const Dressing& dressing = dressed.dressing;
  const int size = maps.tile_size;
  const int side = kTilesAcross * size;
  PointField field{side, side, std::vector<const float*>(static_cast<size_t>(side) * side)};
  for (size_t quad = 0; quad < dressing.mesh.quads.size(); ++quad) {
    const Eigen::Vector3f corner = dressing.mesh.positions[dressing.mesh.quads[quad][0]];
    const int left = static_cast<int>(corner.x()) * size;
    const int top = (kTilesAcross - 1 - static_cast<int>(corner.y())) * size;
    const auto tile = static_cast<int>(dressing.tile[quad]);
    for (int v = 0; v < size; ++v) {
      for (int u = 0; u < size; ++u) {
        const auto [x, y] = TilePixelBeforeTurns(u, v, dressing.turns[quad], size);
        field.points[static_cast<size_t>(top + v) * side + left + u] =
            exemplar.Point(TurnTexel(maps.texel(tile, x, y), dressing.turns[quad]));
      }
    }
  }
  return field;
}

// Over shifts of at least `least` along one axis.
double HighestPeak(const Autocorrelation& autocorrelation, int least) {
  double peak = 0.0;
  for (int dy = 0; dy <= autocorrelation.most_y(); ++dy) {
    for (int dx = -autocorrelation.most_x(); dx <= autocorrelation.most_x(); ++dx) {
      if (std::max(std::abs(dx), dy) >= least) {
        peak = std::max(peak, autocorrelation.at(dx, dy));
      }
    }
  }
  return peak;
}

}  // namespace

absl::StatusOr<nlohmann::json> MeasureRepetition(const Exemplar& exemplar, const Arrangement& arrangement,
                                                 const IndexMaps& maps, int strip_height,
                                                 const RunContext& context) {
  const int shrink = (kTilesAcross * maps.tile_size + kLargestSide - 1) / kLargestSide;
  const int least = std::max(1, strip_height / shrink);
  const int dims = exemplar.search_dims();
  TESSERA_ASSIGN_OR_RETURN(const PointField plane, FieldOfPlane(exemplar, arrangement, maps, context));
  constexpr double kPlaneShare = 0.25;
  constexpr double kExemplarShare = 0.5;
  const auto correlate = [&](const PointField& field, double share, int pixel) {
    return Autocorrelation::Of(field, dims, pixel, static_cast<int>(share * (field.width / pixel)),
                               static_cast<int>(share * (field.height / pixel)), context);
  };
  const PointField material = FieldOfExemplar(exemplar);
  TESSERA_ASSIGN_OR_RETURN(const Autocorrelation of_plane, correlate(plane, kPlaneShare, shrink));
  TESSERA_ASSIGN_OR_RETURN(const Autocorrelation of_material, correlate(material, kExemplarShare, shrink));
  const double plane_peak = HighestPeak(of_plane, least);
  const double material_peak = HighestPeak(of_material, least);
  nlohmann::json figures = {{"plane_peak", plane_peak},
                            {"exemplar_peak", material_peak},
                            {"ratio", material_peak > 0.0 ? plane_peak / material_peak : 1.0}};
  TESSERA_ASSIGN_OR_RETURN(const Autocorrelation sharp, correlate(material, kExemplarShare, 1));
  if (const std::optional<Period> period = FindPeriod(sharp)) {
    const double kept = CorrelationInStep(of_plane, *period, maps.tile_size, shrink);
    const double wanted = CorrelationInStep(of_material, *period, maps.tile_size, shrink);
    figures["period"] = {{"vectors", period->vectors},
                         {"plane", kept},
                         {"exemplar", wanted},
                         {"kept", wanted > 0.0 ? kept / wanted : 1.0}};
  }
  return figures;
}

}  // namespace tessera
