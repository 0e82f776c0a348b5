// How much a plane of tiles repeats itself, against the exemplar.
#pragma once

#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/base/run_context.h"
#include "btf/tiles/exemplar.h"
#include "btf/tiles/index_maps.h"
#include "btf/wang/arrangement.h"

namespace tessera {

// The highest autocorrelation, in the search dimensions of the embedding, of a plane of 16 x 16 tiles and of
// the exemplar: over all shifts of at least a strip height along one axis and at most a quarter of the plane
// (half of the exemplar) along both, about the mean, 1 at no shift, of the texels that overlap. Planes above
// 1,024 texels a side are averaged down, and the exemplar with them.
// Keys: plane_peak, exemplar_peak, ratio (1 where the exemplar's is not above 0); for a regular material
// `period` (regularity.h) with vectors, the autocorrelation of the plane and of the exemplar at multiples of
// them a tile away or farther (`plane`, `exemplar`: CorrelationInStep), and `kept`, the first over the
// second. Errors: of the dressing of the plane; CANCELLED.
[[nodiscard]] absl::StatusOr<nlohmann::json> MeasureRepetition(const Exemplar& exemplar,
                                                               const Arrangement& arrangement,
                                                               const IndexMaps& maps, int strip_height,
                                                               const RunContext& context);

}  // namespace tessera
