#include "btf/meso/microfacet.h"

#include <gtest/gtest.h>

#include "tests/btf/meso/reference_tracer.h"

namespace tessera {
namespace {

// The table is linear between 64 cosines and 24 roughnesses, from 512 samples each.
constexpr double kTableError = 0.006;

TEST(SpecularAlbedoTest, AgreesWithQuadratureOfTheLobe) {
  const SpecularAlbedo specular;
  for (const double roughness : {0.2, 0.35, 0.5, 0.8, 1.0}) {
    for (const double mu : {0.05, 0.2, 0.5, 0.9, 1.0}) {
      for (const double f0 : {0.04, 0.5, 1.0}) {
        const double found = specular.Directional(static_cast<float>(mu), static_cast<float>(roughness),
                                                  static_cast<float>(f0));
        EXPECT_NEAR(found, ReferenceTracer::LobeAlbedo(mu, roughness, f0), kTableError)
            << "mu " << mu << ", roughness " << roughness << ", f0 " << f0;
        EXPECT_LE(found, 1.0);
      }
    }
  }
}

TEST(SpecularAlbedoTest, AverageIsTheCosineMeanOfTheDirectional) {
  const SpecularAlbedo specular;
  for (const float roughness : {0.1F, 0.37F, 0.9F}) {
    double sum = 0.0;
    constexpr int kSteps = 4000;
    for (int i = 0; i < kSteps; ++i) {
      const double mu = (i + 0.5) / kSteps;
      sum += 2.0 * specular.Directional(static_cast<float>(mu), roughness, 0.04F) * mu / kSteps;
    }
    EXPECT_NEAR(specular.Average(roughness, 0.04F), sum, 1e-5);
  }
}

TEST(SpecularAlbedoTest, NoLobeTakesNothing) {
  const SpecularAlbedo specular;
  EXPECT_EQ(specular.Directional(0.3F, 0.5F, 0.0F), 0.0F);
  EXPECT_EQ(specular.Average(0.5F, 0.0F), 0.0F);
}

}  // namespace
}  // namespace tessera
