// The one way a BTF reaches an encoder: rows of texels, every view and light of each.
//
//   std::vector<float> rows(source.SamplesPerRow() * 8);
//   TESSERA_RETURN_IF_ERROR(source.ReadRows(0, 8, rows, context));
//   float v = rows[(((row * width + x) * 3 + channel) * num_views + view) * num_lights + light];
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "btf/base/run_context.h"
#include "btf/math/conventions.h"

namespace tessera {

// Where a material came from; shown to users and inherited by its tile sets.
struct Provenance {
  std::string source;
  std::string licence;
  std::string citation;
};

// What is known of a BTF before any sample is read. Samples exist for every pair of a view and a light.
struct BtfInfo {
  int width = 0;   // texels
  int height = 0;  // texels
  std::vector<Direction> views;
  std::vector<Direction> lights;
  Provenance provenance;
  // How values were brought to the scale of conventions.h, in words ("taken as reflectance, transfer srgb").
  std::string radiometry;
};

// A BTF as a stream of rows. Implementations: importers' spill files, the height-field tracer, memory.
class BtfSource {
 public:
  virtual ~BtfSource() = default;

  [[nodiscard]] virtual const BtfInfo& info() const = 0;

  // Fills `samples` with rows [row_begin, row_begin + num_rows), float32, laid out
  // [row][x][channel 0..2][view][light], light fastest. samples.size() must be num_rows * SamplesPerRow().
  // Encoders ask for rows in ascending order, each once per pass; a source may be read in several passes.
  // Errors: INVALID_ARGUMENT (size or range), CANCELLED, DATA_LOSS or INTERNAL from the medium. Not
  // thread-safe.
  [[nodiscard]] virtual absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                              const RunContext& context) = 0;

  [[nodiscard]] size_t SamplesPerRow() const {
    return static_cast<size_t>(info().width) * 3 * info().views.size() * info().lights.size();
  }
};

}  // namespace tessera
