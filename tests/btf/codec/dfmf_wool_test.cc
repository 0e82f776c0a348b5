// "dfmf" against "dsh" 25 x 25 on the wool of the University of Bonn [Sattler2003]: a twentieth of the bytes
// at less error, on directions that both were made from and on whole lights and whole views that neither saw.
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/data/import.h"
#include "btf/data/subset_btf.h"
#include "tests/support/decoded_error.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

constexpr int kCoefficients = 25;
constexpr uint64_t kDshBytes = uint64_t{128} * 128 * 3 * kCoefficients * kCoefficients;
constexpr int kRowStep = 4;

struct Split {
  std::string name;
  bool holds_views = false;
  bool holds_lights = false;
};

class DfmfWoolTest : public ::testing::TestWithParam<Split> {};

TEST_P(DfmfWoolTest, BeatsDshAtATwentiethOfTheBytes) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto source = ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, {});
  ASSERT_TRUE(source.ok()) << source.status();
  const SampledRows rows = ReadEveryRow(**source, kRowStep);
  const BtfInfo& info = rows.info;
  BtfSubset subset;
  std::vector<int> views = AllOf(info.views);
  std::vector<int> lights = AllOf(info.lights);
  if (GetParam().holds_views) {
    subset.views = KeptDirections(views.size());
    views = HeldOutDirections(views.size());
  }
  if (GetParam().holds_lights) {
    subset.lights = KeptDirections(lights.size());
    lights = HeldOutDirections(lights.size());
  }
  const auto kept = SubsetBtf::Create(**source, subset);
  ASSERT_TRUE(kept.ok()) << kept.status();
  const auto dsh = FindCodec("dsh")->Encode(**kept, {.kl = kCoefficients, .kv = kCoefficients}, {});
  ASSERT_TRUE(dsh.ok()) << dsh.status();
  const double dsh_rmse = DecodedRmse(rows, *dsh, views, lights);
  const auto dfmf = FindCodec("dfmf")->Encode(**kept, {.max_bytes = kDshBytes / 20}, {});
  ASSERT_TRUE(dfmf.ok()) << dfmf.status();
  const double dfmf_rmse = DecodedRmse(rows, *dfmf, views, lights);
  const auto dsh_bytes = MaterialFile(*dsh);
  const auto dfmf_bytes = MaterialFile(*dfmf);
  ASSERT_TRUE(dsh_bytes.ok() && dfmf_bytes.ok());
  std::printf("%s: dsh %llu bytes, RMSE %.5f; dfmf rank %d, %llu bytes, RMSE %.5f\n", GetParam().name.c_str(),
              static_cast<unsigned long long>(dsh_bytes->size_bytes()), dsh_rmse,
              dfmf->btfels.num_coefficients, static_cast<unsigned long long>(dfmf_bytes->size_bytes()),
              dfmf_rmse);
  EXPECT_LE(20 * dfmf_bytes->size_bytes(), dsh_bytes->size_bytes());
  EXPECT_LT(dfmf_rmse, dsh_rmse);
}

INSTANTIATE_TEST_SUITE_P(Splits, DfmfWoolTest,
                         ::testing::Values(Split{"SampledDirections"}, Split{"HeldOutLights", false, true},
                                           Split{"HeldOutViews", true, false}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace tessera
