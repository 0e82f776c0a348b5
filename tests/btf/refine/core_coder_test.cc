#include "btf/refine/core_coder.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "btf/codec/coefficient_tables.h"
#include "tests/btf/refine/errors.h"

namespace tessera {
namespace {

using ::testing::HasSubstr;

std::vector<AngularTable> AngularOf(const BtfelTable& table) {
  return AngularTablesOf(table, *CoefficientTables::Of(table));
}

// RMSE of table entries.
double RmseOfTables(const BtfelTable& table, const CoreSum& sum) {
  auto got = table.tables;
  sum.Write(got);
  double squares = 0.0;
  size_t count = 0;
  for (const AngularTable& each : sum.tables()) {
    const std::vector<float>& whole = table.tables.at(each.name).values;
    for (size_t i = 0; i < whole.size(); ++i) {
      const double error = got.at(each.name).values[i] - whole[i];
      EXPECT_EQ(std::round(got.at(each.name).values[i]), got.at(each.name).values[i]);
      squares += error * error;
      ++count;
    }
  }
  return std::sqrt(squares / static_cast<double>(count));
}

TEST(AngularTablesTest, AreThoseOfViewsLightsAndCoefficients) {
  const std::vector<AngularTable> dfmf = AngularOf(TileSetOf("dfmf", 4).btfels);
  ASSERT_EQ(dfmf.size(), 2u);
  EXPECT_EQ(dfmf[0].name, "chroma");
  EXPECT_EQ(dfmf[0].before_count, 2u);
  EXPECT_EQ(dfmf[1].name, "luma");
  EXPECT_EQ(dfmf[1].before_count, 1u);
  EXPECT_EQ(2 * dfmf[1].num_matrices() + dfmf[0].num_matrices(), 32u);  // 16 coefficients
  const std::vector<AngularTable> view_pca = AngularOf(TileSetOf("view-pca", 4).btfels);
  ASSERT_EQ(view_pca.size(), 1u);
  EXPECT_EQ(view_pca[0].num_matrices(), 3u);  // eigen-textures
  EXPECT_TRUE(AngularOf(TileSetOf("dsh-cls", 4).btfels).empty());
}

// Errors fall with the step, down to the rounding of whole numbers and of the bases.
TEST(CoreCoderTest, FinerStepsBringTablesBack) {
  for (const std::string codec : {"dfmf", "view-pca"}) {
    const BtfelTable table = TileSetOf(codec, 4).btfels;
    const std::vector<AngularTable> angular = AngularOf(table);
    size_t matrices = 0;
    for (const AngularTable& each : angular) {
      matrices += each.num_matrices();
    }
    // A whole number is worth so much that tables are all but exact at the end.
    const double unit = table.tables.at(angular.back().name).dtype == DType::kU8 ? 1.0 : 256.0;
    auto coder = CoreCoder::Create(table, angular, std::vector<double>(matrices, 0.01 / unit));
    ASSERT_TRUE(coder.ok()) << coder.status();
    double last = std::numeric_limits<double>::infinity();
    for (const float step : {0.3F, 0.1F, 0.03F, 0.01F}) {
      const std::vector<int32_t> codes = coder->Finer(step);
      EXPECT_TRUE(codes.empty() || codes.back() != 0);
      const double rmse = RmseOfTables(table, coder->sum());
      EXPECT_LT(rmse, last);
      last = rmse;
    }
    EXPECT_LT(last, 0.6 * unit) << codec;
    EXPECT_TRUE(coder->Finer(0.01F).empty());
  }
}

// What costs nothing takes no codes, and comes as its mean.
TEST(CoreCoderTest, SpendsNothingOnWhatCostsNothing) {
  const BtfelTable table = TileSetOf("dfmf", 4).btfels;
  const std::vector<AngularTable> angular = AngularOf(table);
  const size_t matrices = angular[0].num_matrices() + angular[1].num_matrices();
  std::vector<double> costs(matrices, 0.0);
  costs[matrices - 1] = 0.01;
  auto coder = CoreCoder::Create(table, angular, costs);
  ASSERT_TRUE(coder.ok()) << coder.status();
  const std::vector<int32_t> codes = coder->Finer(0.01F);
  ASSERT_FALSE(codes.empty());
  for (size_t i = 0; i < codes.size(); ++i) {
    EXPECT_TRUE(codes[i] == 0 || i % matrices == matrices - 1) << i;
  }
}

TEST(CoreSumTest, RefusesWhatDoesNotFit) {
  const BtfelTable table = TileSetOf("dfmf", 4).btfels;
  const std::vector<AngularTable> angular = AngularOf(table);
  const size_t matrices = angular[0].num_matrices() + angular[1].num_matrices();
  auto coder = CoreCoder::Create(table, angular, std::vector<double>(matrices, 0.01));
  ASSERT_TRUE(coder.ok()) << coder.status();
  const auto refused = [&](const auto& change, const char* what) {
    CoreBases bases = coder->bases();
    change(bases);
    const absl::Status status = CoreSum::Create(table, angular, std::move(bases)).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << what;
    EXPECT_THAT(status.message(), HasSubstr(what));
  };
  refused([](CoreBases& bases) { bases.mean.pop_back(); }, "means");
  refused([](CoreBases& bases) { bases.unit[0] = INFINITY; }, "units");
  refused([](CoreBases& bases) { bases.view.step[0] = 0.0F; }, "view_basis");
  refused([](CoreBases& bases) { bases.light.codes.pop_back(); }, "light_basis");
  refused(
      [&](CoreBases& bases) {
        bases.light.step.resize(table.lights.size() + 1, 1.0F);
        bases.light.codes.resize(bases.light.step.size() * table.lights.size());
      },
      "light_basis");
  auto sum = CoreSum::Create(table, angular, coder->bases());
  ASSERT_TRUE(sum.ok()) << sum.status();
  EXPECT_FALSE(sum->Add(0.0F, {1}).ok());
  EXPECT_FALSE(sum->Add(1.0F, std::vector<int32_t>(sum->cores().size() + 1, 1)).ok());
  EXPECT_TRUE(sum->Add(1e38F, {2000000000, -2000000000}).ok());
  auto tables = table.tables;
  sum->Write(tables);
  EXPECT_TRUE(
      std::ranges::all_of(tables.at("luma").values, [](float v) { return v >= 0.0F && v <= 255.0F; }));
}

}  // namespace
}  // namespace tessera
