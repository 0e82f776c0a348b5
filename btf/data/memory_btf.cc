#include "btf/data/memory_btf.h"

#include <algorithm>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/status_macros.h"

namespace tessera {

absl::StatusOr<std::unique_ptr<MemoryBtf>> MemoryBtf::Create(BtfInfo info, std::vector<float> samples) {
  if (info.width < 1 || info.height < 1 || info.views.empty() || info.lights.empty()) {
    return absl::InvalidArgumentError(absl::StrCat("BTF of ", info.width, "x", info.height, " texels, ",
                                                   info.views.size(), " views and ", info.lights.size(),
                                                   " lights: each must be at least 1"));
  }
  const size_t expected =
      static_cast<size_t>(info.width) * info.height * 3 * info.views.size() * info.lights.size();
  if (samples.size() != expected) {
    return absl::InvalidArgumentError(
        absl::StrCat("BTF has ", samples.size(), " samples, expected ", expected));
  }
  return std::unique_ptr<MemoryBtf>(new MemoryBtf(std::move(info), std::move(samples)));
}

MemoryBtf::MemoryBtf(BtfInfo info, std::vector<float> samples)
    : info_(std::move(info)), samples_(std::move(samples)) {}

absl::Status MemoryBtf::ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                 const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckReadRows(*this, row_begin, num_rows, samples.size()));
  TESSERA_RETURN_IF_ERROR(context.CheckStop());
  std::copy_n(samples_.begin() + static_cast<ptrdiff_t>(row_begin * SamplesPerRow()), samples.size(),
              samples.begin());
  return absl::OkStatus();
}

absl::Status CheckReadRows(const BtfSource& source, int row_begin, int num_rows, size_t num_samples) {
  const int height = source.info().height;
  if (row_begin < 0 || num_rows < 0 || row_begin > height || num_rows > height - row_begin) {
    return absl::InvalidArgumentError(
        absl::StrCat("rows ", row_begin, " + ", num_rows, " of a BTF of ", height, " rows"));
  }
  if (num_samples != num_rows * source.SamplesPerRow()) {
    return absl::InvalidArgumentError(
        absl::StrCat("room for ", num_samples, " samples, expected ", num_rows * source.SamplesPerRow()));
  }
  return absl::OkStatus();
}

}  // namespace tessera
