#include "btf/data/transposed_samples.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/data/memory_btf.h"

namespace tessera {

namespace {

// The error of the earliest range, whichever thread met it first.
class FirstError {
 public:
  void Set(int64_t position, absl::Status status) {
    const std::lock_guard lock(mutex_);
    if (status_.ok() || position < position_) {
      position_ = position;
      status_ = std::move(status);
    }
  }
  [[nodiscard]] absl::Status Take() { return std::move(status_); }

 private:
  std::mutex mutex_;
  int64_t position_ = 0;
  absl::Status status_;
};

// out[k][i] = in[i][k]; rows of `in` are `stride` bytes apart. Blocked, so that a block's lines stay in
// cache.
template <typename T>
void Transpose(const std::byte* in, size_t stride, int64_t num_images, int64_t num_values, T* out) {
  constexpr int64_t kBlockImages = 64;
  constexpr int64_t kBlockValues = 64;
  for (int64_t i_begin = 0; i_begin < num_images; i_begin += kBlockImages) {
    const int64_t i_end = std::min(num_images, i_begin + kBlockImages);
    for (int64_t k_begin = 0; k_begin < num_values; k_begin += kBlockValues) {
      const int64_t k_end = std::min(num_values, k_begin + kBlockValues);
      for (int64_t k = k_begin; k < k_end; ++k) {
        T* const row = out + k * num_images;
        for (int64_t i = i_begin; i < i_end; ++i) {
          row[i] = reinterpret_cast<const T*>(in + i * stride)[k];
        }
      }
    }
  }
}

void TransposeCodes(size_t sample_bytes, const std::byte* in, size_t stride, int64_t num_images,
                    int64_t num_values, std::byte* out) {
  switch (sample_bytes) {
    case 1:
      return Transpose(in, stride, num_images, num_values, reinterpret_cast<uint8_t*>(out));
    case 2:
      return Transpose(in, stride, num_images, num_values, reinterpret_cast<uint16_t*>(out));
    default:
      return Transpose(in, stride, num_images, num_values, reinterpret_cast<uint32_t*>(out));
  }
}

// Texels per range so that the ranges of all threads together fit into `buffer_bytes`, each at most
// kWriteBytes.
int64_t TexelsPerRange(uint64_t buffer_bytes, int num_threads, uint64_t texel_bytes) {
  const uint64_t bytes = std::min(buffer_bytes / static_cast<uint64_t>(num_threads), kWriteBytes);
  return std::max<int64_t>(1, static_cast<int64_t>(bytes / texel_bytes));
}

class TransposedBtf : public BtfSource {
 public:
  TransposedBtf(BtfInfo info, SampleLayout layout, SampleTable table, std::vector<float> scale,
                std::unique_ptr<SampleStorage> storage, uint64_t buffer_bytes)
      : info_(std::move(info)),
        layout_(layout),
        table_(std::move(table)),
        scale_(std::move(scale)),
        storage_(std::move(storage)),
        buffer_bytes_(buffer_bytes) {}

  [[nodiscard]] const BtfInfo& info() const override { return info_; }

  [[nodiscard]] absl::Status ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                      const RunContext& context) override {
    TESSERA_RETURN_IF_ERROR(CheckReadRows(*this, row_begin, num_rows, samples.size()));
    const int64_t begin = int64_t{row_begin} * info_.width;
    const int64_t end = begin + int64_t{num_rows} * info_.width;
    const int64_t step =
        TexelsPerRange(buffer_bytes_, NumThreads(context), layout_.TotalBytes() / layout_.num_texels);
    FirstError error;
    ParallelFor(context, begin, end, step, [&](int64_t range_begin, int64_t range_end) {
      float* const out = samples.data() + (range_begin - begin) * 3 * layout_.num_pairs;
      if (absl::Status status = ReadTexels(range_begin, range_end, out); !status.ok()) {
        error.Set(range_begin, std::move(status));
      }
    });
    TESSERA_RETURN_IF_ERROR(error.Take());
    return context.CheckStop();
  }

 private:
  absl::Status ReadTexels(int64_t begin, int64_t end, float* out) {
    // Of 32-bit words, so that it is aligned for every width of code.
    const uint64_t texel_bytes = layout_.channels * layout_.batch_pairs * layout_.sample_bytes;
    std::vector<uint32_t> buffer(((end - begin) * texel_bytes + 3) / 4);
    for (int64_t texel = begin; texel < end;) {
      const int64_t piece_end = std::min(end, layout_.GroupEnd(texel));
      for (int64_t batch = 0; batch < layout_.num_batches(); ++batch) {
        const size_t run_bytes = layout_.BatchSize(batch) * layout_.sample_bytes;
        const std::span<std::byte> codes = std::as_writable_bytes(std::span(buffer))
                                               .first((piece_end - texel) * layout_.channels * run_bytes);
        TESSERA_RETURN_IF_ERROR(storage_->Read(layout_.Offset(batch, texel), codes));
        ExpandBatch(batch, piece_end - texel, codes, out + (texel - begin) * 3 * layout_.num_pairs);
      }
      texel = piece_end;
    }
    return absl::OkStatus();
  }

  // Codes [texel][channel][pair in batch] to their places in out[texel][3][pair].
  void ExpandBatch(int64_t batch, int64_t num_texels, std::span<const std::byte> codes, float* out) const {
    const int64_t size = layout_.BatchSize(batch);
    const size_t run_bytes = size * layout_.sample_bytes;
    for (int64_t texel = 0; texel < num_texels; ++texel) {
      float* const values = out + texel * 3 * layout_.num_pairs + layout_.BatchBegin(batch);
      for (int channel = 0; channel < layout_.channels; ++channel) {
        const std::span<float> run(values + channel * layout_.num_pairs, size);
        table_.Convert(codes.subspan((texel * layout_.channels + channel) * run_bytes, run_bytes), run);
        for (int64_t i = 0; !scale_.empty() && i < size; ++i) {
          run[i] *= scale_[layout_.BatchBegin(batch) + i];
        }
      }
      for (int channel = layout_.channels; channel < 3; ++channel) {
        std::copy_n(values, size, values + channel * layout_.num_pairs);
      }
    }
  }

  BtfInfo info_;
  SampleLayout layout_;
  SampleTable table_;
  std::vector<float> scale_;
  std::unique_ptr<SampleStorage> storage_;
  uint64_t buffer_bytes_;
};

}  // namespace

uint64_t SampleLayout::Offset(int64_t batch, int64_t texel) const {
  const int64_t group_begin = texel / group_texels * group_texels;
  const int64_t group_size = GroupEnd(texel) - group_begin;
  const int64_t values_before =
      group_begin * num_pairs + group_size * BatchBegin(batch) + (texel - group_begin) * BatchSize(batch);
  return static_cast<uint64_t>(values_before) * channels * sample_bytes;
}

absl::Status WriteBatch(const SampleLayout& layout, SampleStorage& storage, int64_t batch,
                        int64_t texel_begin, int64_t texel_end, const std::byte* images, size_t image_stride,
                        uint64_t buffer_bytes, const RunContext& context) {
  const int64_t size = layout.BatchSize(batch);
  const uint64_t texel_bytes = size * layout.channels * layout.sample_bytes;
  const int64_t step = TexelsPerRange(buffer_bytes, NumThreads(context), texel_bytes);
  FirstError error;
  ParallelFor(context, texel_begin, texel_end, step, [&](int64_t begin, int64_t end) {
    std::vector<uint32_t> buffer(((end - begin) * texel_bytes + 3) / 4);
    auto* const codes = reinterpret_cast<std::byte*>(buffer.data());
    const size_t skipped = (begin - texel_begin) * layout.channels * layout.sample_bytes;
    TransposeCodes(layout.sample_bytes, images + skipped, image_stride, size, (end - begin) * layout.channels,
                   codes);
    for (int64_t texel = begin; texel < end;) {
      const int64_t piece_end = std::min(end, layout.GroupEnd(texel));
      const std::span<const std::byte> piece(codes + (texel - begin) * texel_bytes,
                                             (piece_end - texel) * texel_bytes);
      if (absl::Status status = storage.Write(layout.Offset(batch, texel), piece); !status.ok()) {
        error.Set(texel, std::move(status));
        return;
      }
      texel = piece_end;
    }
  });
  TESSERA_RETURN_IF_ERROR(error.Take());
  return context.CheckStop();
}

std::unique_ptr<BtfSource> MakeTransposedBtf(BtfInfo info, SampleLayout layout, SampleTable table,
                                             std::vector<float> scale, std::unique_ptr<SampleStorage> storage,
                                             uint64_t buffer_bytes) {
  return std::make_unique<TransposedBtf>(std::move(info), layout, std::move(table), std::move(scale),
                                         std::move(storage), buffer_bytes);
}

}  // namespace tessera
