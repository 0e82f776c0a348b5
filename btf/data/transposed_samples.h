// The samples of a BTF turned from images into texels: written image by image, read texel by texel.
//
// Codes are kept in the images' own width, not as floats: 1 byte a sample for 8-bit images, so that the 6,561
// images of a UBO2003 set of 128 x 128 take 322 MB instead of 1.3 GB, and reading costs one table look-up.
// Pairs are the P = views * lights samples of one texel and channel, in the order of ReadRows. They are
// written in batches of B pairs, as many images as memory holds; texels are laid out in groups:
//
//   file   = group 0, group 1, ..             group = T consecutive texels, row by row
//   group  = batch 0, batch 1, ..             batch = B consecutive pairs
//   batch  = [texel in group][channel][pair in batch]
//
// so that one write is T * C * B codes in one piece (about kWriteBytes), and one read of n texels is one
// piece per batch. With one batch this is the order of ReadRows itself.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "btf/base/run_context.h"
#include "btf/data/btf_source.h"
#include "btf/image/sample_table.h"

namespace tessera {

struct SampleLayout {
  int64_t num_texels = 0;
  int channels = 3;  // C, 1 or 3: gray BTFs keep one
  int64_t num_pairs = 0;
  int64_t batch_pairs = 0;   // B; the last batch may be shorter
  int64_t group_texels = 0;  // T; the last group may be shorter
  size_t sample_bytes = 1;

  [[nodiscard]] int64_t num_batches() const { return (num_pairs + batch_pairs - 1) / batch_pairs; }
  [[nodiscard]] int64_t BatchBegin(int64_t batch) const { return batch * batch_pairs; }
  [[nodiscard]] int64_t BatchSize(int64_t batch) const {
    return std::min(batch_pairs, num_pairs - batch * batch_pairs);
  }
  [[nodiscard]] uint64_t TotalBytes() const {
    return static_cast<uint64_t>(num_texels) * channels * num_pairs * sample_bytes;
  }
  // Where `batch` has its codes of `texel`. Those of the following texels follow, up to GroupEnd(texel).
  [[nodiscard]] uint64_t Offset(int64_t batch, int64_t texel) const;
  [[nodiscard]] int64_t GroupEnd(int64_t texel) const {
    return std::min(num_texels, (texel / group_texels + 1) * group_texels);
  }
};

// About what one write carries, where the budget allows.
inline constexpr uint64_t kWriteBytes = uint64_t{1} << 20;

// Bytes at offsets, thread-safe for disjoint ranges.
class SampleStorage {
 public:
  virtual ~SampleStorage() = default;
  [[nodiscard]] virtual absl::Status Write(uint64_t offset, std::span<const std::byte> bytes) = 0;
  [[nodiscard]] virtual absl::Status Read(uint64_t offset, std::span<std::byte> bytes) = 0;
};

// Errors: RESOURCE_EXHAUSTED.
[[nodiscard]] absl::StatusOr<std::unique_ptr<SampleStorage>> MakeMemoryStorage(uint64_t size_bytes);
// A file without a name in `folder`, its space reserved: gone when the storage is, even after a kill.
// Errors: RESOURCE_EXHAUSTED naming the bytes needed and free; NOT_FOUND, PERMISSION_DENIED, INTERNAL.
[[nodiscard]] absl::StatusOr<std::unique_ptr<SampleStorage>> MakeSpillFile(
    const std::filesystem::path& folder, uint64_t size_bytes);

// Writes texels [texel_begin, texel_end) of `batch`: `images` holds the codes of its images one after the
// other, each [texel][channel] and `image_stride` bytes after the one before. Parallel; buffers take at most
// `buffer_bytes` in all, but at least one texel's codes per thread. Errors: those of Write; nothing is
// written after a stop request.
[[nodiscard]] absl::Status WriteBatch(const SampleLayout& layout, SampleStorage& storage, int64_t batch,
                                      int64_t texel_begin, int64_t texel_end, const std::byte* images,
                                      size_t image_stride, uint64_t buffer_bytes, const RunContext& context);

// The BTF over such samples. `scale` [pairs] multiplies the linear values, empty: all 1. ReadRows allocates
// at most `buffer_bytes`, but at least one texel's codes per thread.
[[nodiscard]] std::unique_ptr<BtfSource> MakeTransposedBtf(BtfInfo info, SampleLayout layout,
                                                           SampleTable table, std::vector<float> scale,
                                                           std::unique_ptr<SampleStorage> storage,
                                                           uint64_t buffer_bytes);

}  // namespace tessera
