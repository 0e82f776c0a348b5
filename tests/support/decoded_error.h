// How far decoded values are from a source's samples.
//
//   const SampledRows rows = ReadEveryRow(source, /*step=*/4);
//   const double rmse = DecodedRmse(rows, material, AllOf(rows.info.views), AllOf(rows.info.lights));
#pragma once

#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include <gtest/gtest.h>

#include "btf/base/parallel.h"
#include "btf/codec/decoder.h"
#include "btf/codec/material.h"
#include "btf/data/btf_source.h"

namespace tessera {

struct SampledRows {
  BtfInfo info;  // of the whole source
  std::vector<int> rows;
  std::vector<float> samples;  // [row][x][channel][view][light]
};

inline SampledRows ReadEveryRow(BtfSource& source, int step) {
  SampledRows result{.info = source.info()};
  for (int y = 0; y < result.info.height; y += step) {
    result.rows.push_back(y);
  }
  result.samples.resize(result.rows.size() * source.SamplesPerRow());
  for (size_t i = 0; i < result.rows.size(); ++i) {
    const absl::Status status = source.ReadRows(
        result.rows[i], 1,
        std::span(result.samples).subspan(i * source.SamplesPerRow(), source.SamplesPerRow()), {});
    EXPECT_TRUE(status.ok()) << status;
  }
  return result;
}

inline std::vector<int> AllOf(const std::vector<Direction>& directions) {
  std::vector<int> all(directions.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// RMSE over the rows' texels in the images of `views` x `lights`, indices into the source's. The material has
// the source's texels, and may have been made from fewer directions.
inline double DecodedRmse(const SampledRows& rows, const Material& material, const std::vector<int>& views,
                          const std::vector<int>& lights) {
  const auto decoder = MakeDecoder(material.btfels);
  EXPECT_TRUE(decoder.ok()) << decoder.status();
  const BtfInfo& info = rows.info;
  const size_t row_codes = static_cast<size_t>(info.width) * material.btfels.num_coefficients;
  std::vector<uint8_t> codes;
  for (const int y : rows.rows) {
    const auto row = std::span(material.btfels.codes).subspan(y * row_codes, row_codes);
    codes.insert(codes.end(), row.begin(), row.end());
  }
  const size_t num_values = rows.rows.size() * info.width * 3;
  const size_t pairs = info.views.size() * info.lights.size();
  std::vector<double> errors(views.size() * lights.size());
  ParallelFor({}, 0, static_cast<int64_t>(errors.size()), 8, [&](int64_t begin, int64_t end) {
    std::vector<float> rgb(num_values);
    for (int64_t i = begin; i < end; ++i) {
      const int v = views[i / lights.size()];
      const int l = lights[i % lights.size()];
      (*decoder)->DecodeTexels(codes, VectorFromDirection(info.lights[l]), VectorFromDirection(info.views[v]),
                               0, rgb);
      const float* const truth = rows.samples.data() + v * info.lights.size() + l;
      for (size_t value = 0; value < num_values; ++value) {
        const double error = static_cast<double>(rgb[value]) - truth[value * pairs];
        errors[i] += error * error;
      }
    }
  });
  return std::sqrt(std::accumulate(errors.begin(), errors.end(), 0.0) /
                   static_cast<double>(errors.size() * num_values));
}

}  // namespace tessera
