#include "btf/tiles/synthesize.h"

namespace tessera {

absl::StatusOr<TileSet> SynthesizeTileSet(const Material&, const Arrangement&, const SynthesisParams&,
                                          const RunContext&) {
  return absl::UnimplementedError("tile synthesis");
}

}  // namespace tessera
