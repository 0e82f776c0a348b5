#include "btf/data/transposed_samples.h"

#include <set>

#include <gtest/gtest.h>

#include "btf/base/rng.h"
#include "btf/data/memory_btf.h"

namespace tessera {
namespace {

TEST(SampleLayoutTest, EveryCodeHasOnePlace) {
  for (const int64_t batch_pairs : {1, 3, 7, 10, 11}) {
    for (const int64_t group_texels : {1, 2, 5, 12, 13}) {
      const SampleLayout layout{13, 3, 11, batch_pairs, group_texels, 2};
      std::set<uint64_t> offsets;
      for (int64_t batch = 0; batch < layout.num_batches(); ++batch) {
        for (int64_t texel = 0; texel < layout.num_texels; ++texel) {
          const uint64_t begin = layout.Offset(batch, texel);
          const uint64_t bytes = layout.BatchSize(batch) * layout.channels * layout.sample_bytes;
          // The next texel of the group follows at once.
          if (texel + 1 < layout.GroupEnd(texel)) {
            EXPECT_EQ(layout.Offset(batch, texel + 1), begin + bytes);
          }
          for (uint64_t i = 0; i < bytes; ++i) {
            ASSERT_TRUE(offsets.insert(begin + i).second);
          }
        }
      }
      EXPECT_EQ(offsets.size(), layout.TotalBytes());
      EXPECT_EQ(*offsets.rbegin() + 1, layout.TotalBytes());
    }
  }
}

TEST(TransposedSamplesTest, BatchesInAnyOrderReadBackAsTexels) {
  constexpr int kWidth = 9;
  constexpr int kHeight = 5;
  constexpr int kTexels = kWidth * kHeight;
  for (const int channels : {1, 3}) {
    const SampleLayout layout{kTexels, channels, 6, 4, 7, 2};
    auto storage = MakeSpillFile(::testing::TempDir(), layout.TotalBytes());
    ASSERT_TRUE(storage.ok()) << storage.status();
    const auto code = [](int texel, int channel, int pair) {
      return static_cast<uint16_t>(Mix64((texel * 3 + channel) * 7 + pair));
    };
    for (const int64_t batch : {1, 0}) {
      std::vector<uint16_t> images;
      for (int64_t i = 0; i < layout.BatchSize(batch); ++i) {
        for (int texel = 0; texel < kTexels; ++texel) {
          for (int channel = 0; channel < channels; ++channel) {
            images.push_back(code(texel, channel, static_cast<int>(layout.BatchBegin(batch) + i)));
          }
        }
      }
      const auto* bytes = reinterpret_cast<const std::byte*>(images.data());
      ASSERT_TRUE(WriteBatch(layout, **storage, batch, 0, kTexels, bytes, kTexels * channels * 2,
                             /*buffer_bytes=*/100, RunContext{})
                      .ok());
    }
    BtfInfo info;
    info.width = kWidth;
    info.height = kHeight;
    info.views.resize(2);
    info.lights.resize(3);
    const auto btf = MakeTransposedBtf(info, layout, SampleTable(SampleType::kU16, Transfer::Linear()),
                                       {1, 2, 3, 4, 5, 6}, *std::move(storage), /*buffer_bytes=*/64);
    std::vector<float> rows(3 * btf->SamplesPerRow());
    ASSERT_TRUE(btf->ReadRows(2, 3, rows, RunContext{}).ok());
    for (int texel = 2 * kWidth; texel < kTexels; ++texel) {
      for (int channel = 0; channel < 3; ++channel) {
        for (int pair = 0; pair < 6; ++pair) {
          const float expected = (pair + 1) * (code(texel, channels == 1 ? 0 : channel, pair) / 65535.0f);
          ASSERT_FLOAT_EQ(rows[((texel - 2 * kWidth) * 3 + channel) * 6 + pair], expected);
        }
      }
    }
  }
}

TEST(MemoryBtfTest, ChecksItsShape) {
  BtfInfo info;
  info.width = 2;
  info.height = 3;
  info.views.resize(1);
  info.lights.resize(4);
  EXPECT_FALSE(MemoryBtf::Create(info, std::vector<float>(71)).ok());
  EXPECT_TRUE(MemoryBtf::Create(info, std::vector<float>(72)).ok());
  info.views.clear();
  EXPECT_FALSE(MemoryBtf::Create(info, {}).ok());
}

TEST(MemoryBtfTest, ReadsRows) {
  BtfInfo info;
  info.width = 2;
  info.height = 3;
  info.views.resize(1);
  info.lights.resize(4);
  std::vector<float> samples(72);
  for (size_t i = 0; i < samples.size(); ++i) {
    samples[i] = static_cast<float>(i);
  }
  const auto btf = MemoryBtf::Create(info, samples).value();
  EXPECT_EQ(btf->at(1, 2, 1, 0, 3), 2 * 24 + 12 + 4 + 3);
  std::vector<float> row(24);
  ASSERT_TRUE(btf->ReadRows(1, 1, row, RunContext{}).ok());
  EXPECT_EQ(row[5], 29.0f);
  EXPECT_FALSE(btf->ReadRows(3, 1, row, RunContext{}).ok());
}

}  // namespace
}  // namespace tessera
