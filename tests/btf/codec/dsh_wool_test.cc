// What the orthonormalised basis of "dsh" gains over the paper's constrained least squares at the same bytes,
// on the wool of the University of Bonn [Sattler2003].
#include <cstdio>

#include <gtest/gtest.h>

#include "btf/codec/codec.h"
#include "btf/data/import.h"
#include "tests/support/decoded_error.h"
#include "tests/support/test_data.h"

namespace tessera {
namespace {

TEST(DshWoolTest, BeatsConstrainedLeastSquaresAtTheSameBytes) {
  TESSERA_REQUIRE_DATA(kWool);
  const auto source = ImportBtf(TestData(kWool), {.transfer = Transfer{TransferKind::kGamma, 2.2}}, {});
  ASSERT_TRUE(source.ok()) << source.status();
  constexpr int kRowStep = 4;
  const SampledRows rows = ReadEveryRow(**source, kRowStep);
  const auto rmse = [&](const char* id, ClsEnergy energy) {
    const auto material = FindCodec(id)->Encode(**source, {.kl = 25, .kv = 25, .cls_energy = energy}, {});
    EXPECT_TRUE(material.ok()) << material.status();
    return DecodedRmse(rows, *material, AllOf(rows.info.views), AllOf(rows.info.lights));
  };
  const double dsh = rmse("dsh", {});
  const double hemisphere = rmse("dsh-cls", ClsEnergy::kHemisphere);
  const double sphere = rmse("dsh-cls", ClsEnergy::kSphere);
  std::printf("RMSE: dsh %.5f, dsh-cls %.5f (2 pi), %.5f (4 pi); ratios %.3f, %.3f\n", dsh, hemisphere,
              sphere, dsh / hemisphere, dsh / sphere);
  EXPECT_LE(dsh, 0.66 * hemisphere);
  EXPECT_LE(dsh, 0.85 * sphere);
}

}  // namespace
}  // namespace tessera
