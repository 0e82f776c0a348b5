// What an import must give back: the same samples through every layout, container, budget and thread count.
#include "btf/data/import.h"

#include <cmath>
#include <filesystem>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/btf_files.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

std::unique_ptr<MemoryBtf> SmallBtf() {
  return AsymmetricBtf(19, 13, WholeDegreeDirections(2, 4), WholeDegreeDirections(1, 5));
}

std::vector<float> AllSamples(BtfSource& source, int rows_at_a_time = 4) {
  std::vector<float> samples(source.info().height * source.SamplesPerRow());
  for (int y = 0; y < source.info().height; y += rows_at_a_time) {
    const int num_rows = std::min(rows_at_a_time, source.info().height - y);
    const absl::Status status = source.ReadRows(
        y, num_rows,
        std::span(samples).subspan(y * source.SamplesPerRow(), num_rows * source.SamplesPerRow()),
        RunContext{});
    EXPECT_TRUE(status.ok()) << status;
  }
  return samples;
}

void ExpectSameDirections(std::span<const Direction> actual, std::span<const Direction> expected) {
  ASSERT_EQ(actual.size(), expected.size());
  for (size_t i = 0; i < actual.size(); ++i) {
    // Files hold degrees as floats or nine digits.
    EXPECT_NEAR(actual[i].theta_rad, expected[i].theta_rad, 1e-6);
    EXPECT_NEAR(actual[i].phi_rad, expected[i].phi_rad, 1e-6);
  }
}

// `tolerance` bounds the difference of sRGB values.
void ExpectSameBtf(BtfSource& actual, const MemoryBtf& expected, double tolerance) {
  ASSERT_EQ(actual.info().width, expected.info().width);
  ASSERT_EQ(actual.info().height, expected.info().height);
  ExpectSameDirections(actual.info().views, expected.info().views);
  ExpectSameDirections(actual.info().lights, expected.info().lights);
  const std::vector<float> samples = AllSamples(actual);
  ASSERT_EQ(samples.size(), expected.samples().size());
  for (size_t i = 0; i < samples.size(); ++i) {
    ASSERT_NEAR(SrgbFromLinear(samples[i]), SrgbFromLinear(expected.samples()[i]), tolerance) << i;
  }
}

struct LayoutCase {
  std::string name;
  ImportLayout layout;
  double tolerance;  // of sRGB values
  // Writes the BTF below the folder and returns the path to import.
  std::function<std::filesystem::path(const MemoryBtf&, const std::filesystem::path&)> write;
};

void PrintTo(const LayoutCase& value, std::ostream* out) {
  *out << value.name;
}

// The samples are 8-bit codes, so 8-bit files hold them exactly; the rest is rounding of the formats.
constexpr double kExact = 1e-6;
constexpr double kHalfTolerance = 1e-3;
constexpr double kJpegTolerance = 5.5 / 255.0;

LayoutCase Ubo(std::string name, TestImageKind kind, double tolerance) {
  return {std::move(name), ImportLayout::kUbo2003, tolerance,
          [kind](const MemoryBtf& btf, const auto& folder) {
            WriteFolder(Ubo2003Files(btf, kind, "TEST19/"), folder);
            return folder;
          }};
}

std::vector<LayoutCase> LayoutCases() {
  return {
      Ubo("UboPng", TestImageKind::kPng8, kExact),
      Ubo("UboPng16", TestImageKind::kPng16, 1.0 / 65535),
      Ubo("UboJpeg", TestImageKind::kJpeg, kJpegTolerance),
      Ubo("UboExr", TestImageKind::kExrHalf, kHalfTolerance),
      {"UboFlatZip", ImportLayout::kUbo2003, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteZip(Ubo2003Files(btf, TestImageKind::kPng8, ""), folder / "a.zip", ZipPacking::kStored);
         return folder / "a.zip";
       }},
      {"UboDeflatedExrZip", ImportLayout::kUbo2003, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteZip(Ubo2003Files(btf, TestImageKind::kExrFloat, "X/"), folder / "b", ZipPacking::kDeflated);
         return folder / "b";
       }},
      {"UboStoredExrZip", ImportLayout::kUbo2003, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteZip(Ubo2003Files(btf, TestImageKind::kExrFloat, "X/"), folder / "b", ZipPacking::kStored);
         return folder / "b";
       }},
      {"ManifestJson", ImportLayout::kManifest, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteFolder(ManifestFiles(btf, TestImageKind::kPng8, ManifestKind::kJson), folder);
         return folder;
       }},
      {"ManifestCsv", ImportLayout::kManifest, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteFolder(ManifestFiles(btf, TestImageKind::kPng8, ManifestKind::kCsv), folder);
         return folder / "manifest.csv";
       }},
      {"ManifestZip", ImportLayout::kManifest, kHalfTolerance,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteZip(ManifestFiles(btf, TestImageKind::kExrHalf, ManifestKind::kCsv), folder / "m.zip",
                  ZipPacking::kDeflated);
         return folder / "m.zip";
       }},
      {"ExrHalf", ImportLayout::kExr, kHalfTolerance,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteFolder({{"btf.exr", MultiPartExr(btf, ExrPartKind::kHalf)}}, folder);
         return folder / "btf.exr";
       }},
      {"ExrFloat", ImportLayout::kExr, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteFolder({{"btf.exr", MultiPartExr(btf, ExrPartKind::kFloat)}}, folder);
         return folder / "btf.exr";
       }},
      {"ExrInZip", ImportLayout::kExr, kExact,
       [](const MemoryBtf& btf, const auto& folder) {
         WriteZip({{"btf.exr", MultiPartExr(btf, ExrPartKind::kFloat)}}, folder / "e.zip",
                  ZipPacking::kDeflated);
         return folder / "e.zip";
       }},
  };
}

class LayoutTest : public ::testing::TestWithParam<LayoutCase> {};
INSTANTIATE_TEST_SUITE_P(All, LayoutTest, ::testing::ValuesIn(LayoutCases()),
                         [](const auto& info) { return info.param.name; });

TEST_P(LayoutTest, SamplesComeBackUnturnedAndUnflipped) {
  const auto btf = SmallBtf();
  const ScratchFolder folder;
  const std::filesystem::path path = GetParam().write(*btf, folder.path());
  for (const ImportLayout layout : {ImportLayout::kAuto, GetParam().layout}) {
    auto source = ImportBtf(path, {.layout = layout}, RunContext{});
    ASSERT_TRUE(source.ok()) << source.status();
    ExpectSameBtf(**source, *btf, GetParam().tolerance);
  }
  for (const ImportLayout layout : {ImportLayout::kUbo2003, ImportLayout::kManifest, ImportLayout::kExr}) {
    if (layout != GetParam().layout) {
      EXPECT_EQ(ImportBtf(path, {.layout = layout}, RunContext{}).status().code(),
                absl::StatusCode::kInvalidArgument);
    }
  }
}

// Handedness in terms of what is seen: a texel on a slope that faces the top of the picture is brightest with
// the light at azimuth 90 degrees, one that faces right with the light at azimuth 0.
TEST_P(LayoutTest, LightsComeFromWhereTheShadingSaysTheyDo) {
  BtfInfo info;
  info.width = 2;
  info.height = 2;
  info.views = {{0.0, 0.0}};
  for (int i = 0; i < 4; ++i) {
    info.lights.push_back({RadFromDeg(60.0), RadFromDeg(90.0 * i)});
  }
  // A pyramid: the slope of each texel faces away from the centre of the picture, its top right one to (1,
  // 1).
  std::vector<float> samples;
  for (const double normal_y : {1.0, -1.0}) {  // rows from the top
    for (const double normal_x : {-1.0, 1.0}) {
      for (int channel = 0; channel < 3; ++channel) {
        for (const Direction& light : info.lights) {
          const Eigen::Vector3d normal = Eigen::Vector3d(0.3 * normal_x, 0.4 * normal_y, 1.0).normalized();
          samples.push_back(static_cast<float>(std::max(0.0, normal.dot(VectorFromDirection(light)))));
        }
      }
    }
  }
  const auto btf = MemoryBtf::Create(info, samples);
  ASSERT_TRUE(btf.ok());
  const ScratchFolder folder;
  auto source = ImportBtf(GetParam().write(**btf, folder.path()), {}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  const std::vector<float> read = AllSamples(**source);
  const auto value = [&](int x, int y, int light) { return read[((y * 2 + x) * 3 + 1) * 4 + light]; };
  for (int i = 0; i < 2; ++i) {
    EXPECT_GT(value(i, 0, 1), value(i, 1, 1) + 0.2);  // light above: the upper texels face it
    EXPECT_GT(value(i, 1, 3), value(i, 0, 3) + 0.2);  // light below
    EXPECT_GT(value(1, i, 0), value(0, i, 0) + 0.2);  // light at the right
    EXPECT_GT(value(0, i, 2), value(1, i, 2) + 0.2);  // light at the left
  }
}

}  // namespace
}  // namespace tessera
