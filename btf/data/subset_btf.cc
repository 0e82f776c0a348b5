#include "btf/data/subset_btf.h"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <utility>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/data/memory_btf.h"

namespace tessera {
namespace {

absl::Status CheckIndices(std::string_view what, const std::vector<int>& indices, size_t count) {
  int previous = -1;
  for (const int index : indices) {
    if (index < 0 || index >= static_cast<int>(count) || index <= previous) {
      return absl::InvalidArgumentError(absl::StrCat("subset: ", std::string(what), " ", index, " after ",
                                                     previous, ": expected ascending indices below ", count));
    }
    previous = index;
  }
  return absl::OkStatus();
}

std::vector<int> AllWhenEmpty(std::vector<int> indices, size_t count) {
  if (indices.empty()) {
    indices.resize(count);
    std::iota(indices.begin(), indices.end(), 0);
  }
  return indices;
}

std::vector<Direction> Select(const std::vector<Direction>& directions, const std::vector<int>& indices) {
  std::vector<Direction> selected;
  for (const int index : indices) {
    selected.push_back(directions[index]);
  }
  return selected;
}

}  // namespace

std::vector<int> HeldOutDirections(size_t count) {
  std::vector<int> indices;
  for (size_t i = kHeldOutStride - 1; i < count; i += kHeldOutStride) {
    indices.push_back(static_cast<int>(i));
  }
  return indices;
}

std::vector<int> KeptDirections(size_t count) {
  std::vector<int> indices;
  for (size_t i = 0; i < count; ++i) {
    if (i % kHeldOutStride != kHeldOutStride - 1) {
      indices.push_back(static_cast<int>(i));
    }
  }
  return indices;
}

absl::StatusOr<std::unique_ptr<SubsetBtf>> SubsetBtf::Create(BtfSource& source, const BtfSubset& subset) {
  const BtfInfo& info = source.info();
  TESSERA_RETURN_IF_ERROR(CheckIndices("view", subset.views, info.views.size()));
  TESSERA_RETURN_IF_ERROR(CheckIndices("light", subset.lights, info.lights.size()));
  TESSERA_RETURN_IF_ERROR(CheckIndices("column", subset.columns, static_cast<size_t>(info.width)));
  TESSERA_RETURN_IF_ERROR(CheckIndices("row", subset.rows, static_cast<size_t>(info.height)));
  return std::unique_ptr<SubsetBtf>(new SubsetBtf(source, subset));
}

SubsetBtf::SubsetBtf(BtfSource& source, BtfSubset subset)
    : source_(source), subset_(std::move(subset)), info_(source.info()) {
  const BtfInfo& all = source.info();
  subset_.views = AllWhenEmpty(std::move(subset_.views), all.views.size());
  subset_.lights = AllWhenEmpty(std::move(subset_.lights), all.lights.size());
  subset_.columns = AllWhenEmpty(std::move(subset_.columns), static_cast<size_t>(all.width));
  subset_.rows = AllWhenEmpty(std::move(subset_.rows), static_cast<size_t>(all.height));
  info_.views = Select(all.views, subset_.views);
  info_.lights = Select(all.lights, subset_.lights);
  info_.width = static_cast<int>(subset_.columns.size());
  info_.height = static_cast<int>(subset_.rows.size());
}

void SubsetBtf::Gather(std::span<const float> source_row, std::span<float> row) const {
  const size_t num_views = source_.info().views.size();
  const size_t num_lights = source_.info().lights.size();
  float* out = row.data();
  for (const int x : subset_.columns) {
    for (size_t channel = 0; channel < 3; ++channel) {
      const float* pairs =
          source_row.data() + (static_cast<size_t>(x) * 3 + channel) * num_views * num_lights;
      for (const int view : subset_.views) {
        const float* of_view = pairs + static_cast<size_t>(view) * num_lights;
        if (subset_.lights.size() == num_lights) {
          out = std::copy_n(of_view, num_lights, out);
          continue;
        }
        for (const int light : subset_.lights) {
          *out++ = of_view[light];
        }
      }
    }
  }
}

absl::Status SubsetBtf::ReadRows(int row_begin, int num_rows, std::span<float> samples,
                                 const RunContext& context) {
  TESSERA_RETURN_IF_ERROR(CheckReadRows(*this, row_begin, num_rows, samples.size()));
  const size_t source_row = source_.SamplesPerRow();
  const size_t own_row = SamplesPerRow();
  const int block_rows =
      static_cast<int>(std::max<size_t>(1, kSubsetBlockBytes / (source_row * sizeof(float))));
  std::vector<float> block;
  for (int done = 0; done < num_rows;) {
    // Rows that follow each other in the source are read together.
    const int first = subset_.rows[row_begin + done];
    int count = 1;
    while (count < block_rows && done + count < num_rows &&
           subset_.rows[row_begin + done + count] == first + count) {
      ++count;
    }
    block.resize(count * source_row);
    TESSERA_RETURN_IF_ERROR(source_.ReadRows(first, count, block, context));
    ParallelFor(context, 0, count, 1, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row) {
        Gather(std::span(block).subspan(row * source_row, source_row),
               samples.subspan((done + row) * own_row, own_row));
      }
    });
    TESSERA_RETURN_IF_ERROR(context.CheckStop());
    done += count;
  }
  return absl::OkStatus();
}

}  // namespace tessera
