// What an import must give back: the same samples through every layout, container, budget and thread count.
#include "btf/data/import.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <ostream>
#include <stop_token>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/btf_files.h"
#include "tests/support/read_btf.h"
#include "tests/support/temp_folder.h"

namespace tessera {
namespace {

std::unique_ptr<MemoryBtf> SmallBtf() {
  return AsymmetricBtf(19, 13, WholeDegreeDirections(2, 4), WholeDegreeDirections(1, 5));
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
  const TempFolder folder;
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
  const TempFolder folder;
  auto source = ImportBtf(GetParam().write(**btf, folder.path()), {}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  const std::vector<float> read = AllSamples(**source);
  // The green value under the light that is said to have this azimuth.
  const auto value = [&](int x, int y, double azimuth_deg) {
    const std::vector<Direction>& lights = (*source)->info().lights;
    const auto light = std::find_if(lights.begin(), lights.end(), [&](const Direction& direction) {
      return std::abs(DegFromRad(direction.phi_rad) - azimuth_deg) < 1e-3;
    });
    return light == lights.end() ? std::nanf("") : read[((y * 2 + x) * 3 + 1) * 4 + (light - lights.begin())];
  };
  for (int i = 0; i < 2; ++i) {
    EXPECT_GT(value(i, 0, 90), value(i, 1, 90) + 0.2);    // light above: the upper texels face it
    EXPECT_GT(value(i, 1, 270), value(i, 0, 270) + 0.2);  // light below
    EXPECT_GT(value(1, i, 0), value(0, i, 0) + 0.2);      // light at the right
    EXPECT_GT(value(0, i, 180), value(1, i, 180) + 0.2);  // light at the left
  }
}

TEST(ImportTest, TransferScaleAndProvenanceAreApplied) {
  CodeImage gray(2, 1, 1);
  gray.at(0, 0, 0) = 128;
  gray.at(1, 0, 0) = 255;
  CodeImage colour(2, 1, 3);
  colour.at(0, 0, 1) = 128;
  const TempFolder folder;
  WriteFolder(
      {{"a.png", MakePng(gray, 8)},
       {"b.png", MakePng(colour, 8)},
       {"manifest.json", R"({"transfer": "linear", "source": "s", "licence": "l", "citation": "c", "images": [
                 {"file": "a.png", "lightPolarDeg": 0, "lightAzimuthDeg": 0, "viewPolarDeg": 0, "viewAzimuthDeg": 0},
                 {"file": "b.png", "lightPolarDeg": 9, "lightAzimuthDeg": -90, "viewPolarDeg": 0,
                  "viewAzimuthDeg": 77, "scale": 2.5}]})"}},
      folder.path());
  const double x = 128.0 / 255.0;
  const auto manifest = ImportBtf(folder.path(), {.provenance = {.licence = "mine"}}, RunContext{});
  ASSERT_TRUE(manifest.ok()) << manifest.status();
  EXPECT_EQ((*manifest)->info().provenance.source, "s");
  EXPECT_EQ((*manifest)->info().provenance.licence, "mine");
  EXPECT_EQ((*manifest)->info().provenance.citation, "c");
  EXPECT_THAT((*manifest)->info().radiometry, testing::HasSubstr("transfer linear"));
  EXPECT_THAT((*manifest)->info().radiometry, testing::HasSubstr("scale"));
  ASSERT_EQ((*manifest)->info().views.size(), 1u);  // azimuths at the pole are one direction
  EXPECT_NEAR((*manifest)->info().lights[1].phi_rad, RadFromDeg(270.0), 1e-12);
  const std::vector<float> samples = AllSamples(**manifest);  // [x][channel][light]
  EXPECT_FLOAT_EQ(samples[0], x);
  EXPECT_FLOAT_EQ(samples[2], x);  // gray in every channel
  EXPECT_FLOAT_EQ(samples[4], x);
  EXPECT_FLOAT_EQ(samples[1], 0.0);
  EXPECT_FLOAT_EQ(samples[3], 2.5 * x);
  EXPECT_FLOAT_EQ(samples[6], 1.0);

  const auto gamma =
      ImportBtf(folder.path(), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, RunContext{});
  ASSERT_TRUE(gamma.ok());
  EXPECT_FLOAT_EQ(AllSamples(**gamma)[0], std::pow(x, 2.2));
}

TEST(ImportTest, ImagesOfSeveralTypesAreStoredAsLinearValues) {
  const auto btf = AsymmetricBtf(9, 7, {{0.0, 0.0}}, WholeDegreeDirections(1, 5));
  FileMap files = ManifestFiles(*btf, TestImageKind::kPng8, ManifestKind::kCsv);
  files["images/1_0.png"] = MakeBtfImage(*btf, 0, 1, TestImageKind::kExrFloat);  // the bytes say what it is
  files["images/2_0.png"] = MakeBtfImage(*btf, 0, 2, TestImageKind::kPng16);
  const TempFolder folder;
  WriteFolder(files, folder.path());
  const auto source = ImportBtf(folder.path(), {}, RunContext{});
  ASSERT_TRUE(source.ok()) << source.status();
  ExpectSameBtf(**source, *btf, 1.0 / 65535);
  EXPECT_THAT((*source)->info().radiometry, testing::HasSubstr("srgb for PNG and JPEG, linear for EXR"));
}

TEST(ImportTest, EveryBudgetAndNumberOfThreadsGivesTheSameSamples) {
  const auto btf = AsymmetricBtf(72, 50, WholeDegreeDirections(1, 8), WholeDegreeDirections(2, 10));
  const TempFolder folder;
  WriteZip(Ubo2003Files(*btf, TestImageKind::kPng8, ""), folder.path() / "a.zip", ZipPacking::kDeflated);
  std::vector<float> first;
  for (const uint64_t budget : {uint64_t{512} << 20, uint64_t{5} << 20, kMinImportBudgetBytes}) {
    for (const int num_threads : {1, 2, 8}) {
      RunContext context;
      context.num_threads = num_threads;
      auto source = ImportBtf(folder.path() / "a.zip", {.memory_budget_bytes = budget}, context);
      ASSERT_TRUE(source.ok()) << source.status();
      const std::vector<float> samples = AllSamples(**source, 7, num_threads);
      if (first.empty()) {
        first = samples;
        ExpectSameBtf(**source, *btf, kExact);
      }
      ASSERT_TRUE(samples == first) << budget << " bytes, " << num_threads << " threads";
    }
  }
}

TEST(ImportTest, ImagesBeyondTheBudgetAreReadInBands) {
  const auto btf = AsymmetricBtf(640, 600, {{0.0, 0.0}}, WholeDegreeDirections(1, 3));  // 1.15 MB an image
  for (const TestImageKind kind : {TestImageKind::kPng8, TestImageKind::kExrFloat}) {
    const TempFolder folder;
    WriteFolder(Ubo2003Files(*btf, kind, ""), folder.path());
    auto source = ImportBtf(folder.path(), {.memory_budget_bytes = kMinImportBudgetBytes}, RunContext{});
    ASSERT_TRUE(source.ok()) << source.status();
    ExpectSameBtf(**source, *btf, kExact);
  }
}

TEST(ImportTest, ReadRowsChecksItsArguments) {
  const auto btf = SmallBtf();
  const TempFolder folder;
  WriteFolder(Ubo2003Files(*btf, TestImageKind::kPng8, ""), folder.path());
  auto source = ImportBtf(folder.path(), {}, RunContext{});
  ASSERT_TRUE(source.ok());
  std::vector<float> row((*source)->SamplesPerRow());
  EXPECT_TRUE((*source)->ReadRows(12, 1, row, RunContext{}).ok());
  EXPECT_EQ((*source)->ReadRows(13, 1, row, RunContext{}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*source)->ReadRows(-1, 1, row, RunContext{}).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*source)->ReadRows(0, 2, row, RunContext{}).code(), absl::StatusCode::kInvalidArgument);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ((*source)->ReadRows(0, 1, row, RunContext{.stop = stop.get_token()}).code(),
            absl::StatusCode::kCancelled);
}

TEST(ImportTest, LayoutNames) {
  EXPECT_EQ(ParseImportLayout("exr").value(), ImportLayout::kExr);
  EXPECT_EQ(ParseImportLayout("ubo2003").value(), ImportLayout::kUbo2003);
  EXPECT_THAT(std::string(ParseImportLayout("btf").status().message()),
              testing::HasSubstr("ubo2003, manifest"));
}

}  // namespace
}  // namespace tessera
