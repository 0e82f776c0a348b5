// The reflectance of a surface point: a GGX lobe and the diffuse light it leaves over.
//
//   specular  f_s = D(n.h) G2(wi, wo) F(wi.h) / (4 n.wi n.wo), GGX with height-correlated Smith [Heitz2014],
//             Schlick's Fresnel term; alpha = roughness^2
//   diffuse   f_d = albedo / pi * (1 - E(n.wi)) (1 - E(n.wo)) / (1 - E_avg)      [Kelemen2001]
//             E(mu) the albedo of the specular lobe for light along mu, E_avg = 2 integral of E(mu) mu dmu
//
// Their sum is reciprocal and, for a white albedo, reflects exactly what arrives: the diffuse part takes what
// the lobe leaves. With f0 = 0 the lobe is switched off and f_d is Lambert's.
#pragma once

#include <vector>

namespace tessera {

// Below this the lobe is narrower than a facet's change of normal, and float cancels in D.
inline constexpr float kMinRoughness = 0.1F;

// alpha of GGX; `roughness` is clamped to [kMinRoughness, 1].
[[nodiscard]] float GgxAlpha(float roughness);

// E and E_avg of the lobe, tabulated over mu and roughness. Built once (50 ms); reading is thread-safe.
class SpecularAlbedo {
 public:
  SpecularAlbedo();

  // In [0, 1]; mu = cosine to the normal in [0, 1], roughness in [0, 1], f0 in [0, 1]. 0 where f0 is 0.
  [[nodiscard]] float Directional(float mu, float roughness, float f0) const;
  [[nodiscard]] float Average(float roughness, float f0) const;

 private:
  // Share of the lobe's energy without and with Schlick's factor: E = f0 * (1 - p) + p.
  struct Shares {
    float base = 0.0F;     // mean of G2/G1 (1 - (1 - wo.h)^5)
    float grazing = 0.0F;  // mean of G2/G1 (1 - wo.h)^5
  };
  [[nodiscard]] Shares Interpolate(float mu, float roughness) const;

  std::vector<Shares> directional_;  // [roughness][mu]
  std::vector<Shares> average_;      // [roughness]
};

}  // namespace tessera
