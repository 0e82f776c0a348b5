// A BTF held in memory: small measured sets, tests.
//
//   auto btf = MemoryBtf::Create(info, samples);   // StatusOr<std::unique_ptr<MemoryBtf>>
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <absl/status/statusor.h>

#include "btf/data/btf_source.h"

namespace tessera {

class MemoryBtf : public BtfSource {
 public:
  // `samples` holds every row in the layout of ReadRows: [y][x][channel][view][light].
  // Errors: INVALID_ARGUMENT when the size disagrees with `info`.
  [[nodiscard]] static absl::StatusOr<std::unique_ptr<MemoryBtf>> Create(BtfInfo info,
                                                                         std::vector<float> samples);

  [[nodiscard]] const BtfInfo& info() const override { return info_; }
  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override;

  [[nodiscard]] std::span<const float> samples() const { return samples_; }
  [[nodiscard]] float at(int x, int y, int channel, size_t view, size_t light) const {
    const size_t texel = static_cast<size_t>(y) * info_.width + x;
    return samples_[((texel * 3 + channel) * info_.views.size() + view) * info_.lights.size() + light];
  }

 private:
  MemoryBtf(BtfInfo info, std::vector<float> samples);

  BtfInfo info_;
  std::vector<float> samples_;
};

// The checks that every ReadRows begins with. Errors: INVALID_ARGUMENT naming the range or the size.
[[nodiscard]] absl::Status CheckReadRows(const BtfSource& source, int row_begin, int num_rows,
                                         size_t num_samples);

}  // namespace tessera
