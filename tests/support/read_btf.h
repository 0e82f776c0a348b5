// All samples of a BTF at once.
#pragma once

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "btf/data/btf_source.h"

namespace tessera {

inline std::vector<float> AllSamples(BtfSource& source, int rows_at_a_time = 4, int num_threads = 0) {
  RunContext context;
  context.num_threads = num_threads;
  const size_t per_row = source.SamplesPerRow();
  std::vector<float> samples(source.info().height * per_row);
  for (int y = 0; y < source.info().height; y += rows_at_a_time) {
    const int num_rows = std::min(rows_at_a_time, source.info().height - y);
    const absl::Status status =
        source.ReadRows(y, num_rows, std::span(samples).subspan(y * per_row, num_rows * per_row), context);
    EXPECT_TRUE(status.ok()) << status;
  }
  return samples;
}

}  // namespace tessera
