#include "btf/codec/embedding.h"

#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include <absl/strings/str_cat.h>

#include "btf/base/parallel.h"
#include "btf/base/status_macros.h"
#include "btf/codec/decoder.h"
#include "btf/codec/feature_pca.h"
#include "btf/math/hemisphere_gram.h"

namespace tessera {
namespace {

constexpr int kPolarAngles = 3;
constexpr int kAzimuths = 8;
constexpr int64_t kImagesPerTask = 16;

struct Node {
  Eigen::Vector3d direction;
  double weight = 0.0;  // steradians
};

// Node 4 i + t is node 4 i as a texel turned t times sees it.
std::vector<Node> MakeNodes() {
  const GaussLegendreRule polar = GaussLegendre(kPolarAngles);
  std::vector<Node> nodes;
  for (int ring = 0; ring < kPolarAngles; ++ring) {
    for (int i = 0; i < kAzimuths / kQuarterTurns; ++i) {
      const Eigen::Vector3d first = VectorFromDirection(
          {.theta_rad = std::acos(polar.nodes[ring]), .phi_rad = 2.0 * kPi * (i + 0.5) / kAzimuths});
      for (int turns = 0; turns < kQuarterTurns; ++turns) {
        nodes.push_back({UnturnedFromTurned(first, turns), polar.weights[ring] * 2.0 * kPi / kAzimuths});
      }
    }
  }
  return nodes;
}

// Of images of which number 4 i + t is number 4 i as a texel turned t times sees it.
FeatureTurns TurnsOfImages(int num_images) {
  std::array<std::vector<int>, kQuarterTurns> source;
  std::array<std::vector<double>, kQuarterTurns> sign;
  for (int turns = 0; turns < kQuarterTurns; ++turns) {
    for (int image = 0; image < num_images; ++image) {
      const int from = image / kQuarterTurns * kQuarterTurns + (image + turns) % kQuarterTurns;
      for (int channel = 0; channel < 3; ++channel) {
        source[turns].push_back(3 * from + channel);
        sign[turns].push_back(1.0);
      }
    }
  }
  return {std::move(source), std::move(sign)};
}

// Feature 3 image + channel is the decoded value times the image's weight.
class DecodedFeatures final : public TexelFeatures {
 public:
  // Each of `images` in all four turns.
  DecodedFeatures(const BtfelTable& table, const Decoder& decoder, const std::vector<WeightedImage>& images)
      : table_(table),
        decoder_(decoder),
        turns_(TurnsOfImages(kQuarterTurns * static_cast<int>(images.size()))) {
    for (const WeightedImage& image : images) {
      for (int turns = 0; turns < kQuarterTurns; ++turns) {
        images_.push_back(
            {UnturnedFromTurned(image.light, turns), UnturnedFromTurned(image.view, turns), image.weight});
      }
    }
  }

  [[nodiscard]] const FeatureTurns& turns() const override { return turns_; }

  void Compute(int64_t begin, int64_t end, Eigen::MatrixXf& features,
               const RunContext& context) const override {
    const int64_t num_texels = end - begin;
    const size_t k = static_cast<size_t>(table_.num_coefficients);
    const std::span<const uint8_t> codes = std::span(table_.codes).subspan(begin * k, num_texels * k);
    ParallelFor(context, 0, static_cast<int64_t>(images_.size()), kImagesPerTask,
                [&](int64_t first, int64_t last) {
                  std::vector<float> rgb(static_cast<size_t>(3 * num_texels * (last - first)));
                  for (int64_t i = first; i < last; ++i) {
                    const std::span<float> values =
                        std::span(rgb).subspan((i - first) * 3 * num_texels, 3 * num_texels);
                    const WeightedImage& image = images_[i];
                    decoder_.DecodeTexels(codes, image.light, image.view, /*turns=*/0, values);
                    for (float& value : values) {
                      value *= static_cast<float>(image.weight);
                    }
                  }
                  for (int64_t n = 0; n < num_texels; ++n) {
                    for (int64_t i = first; i < last; ++i) {
                      features.col(n).segment<3>(3 * i) =
                          Eigen::Map<const Eigen::Vector3f>(rgb.data() + 3 * ((i - first) * num_texels + n));
                    }
                  }
                });
  }

 private:
  const BtfelTable& table_;
  const Decoder& decoder_;
  std::vector<WeightedImage> images_;
  FeatureTurns turns_;
};

}  // namespace

absl::StatusOr<Embedding> EmbedImages(const Material& material, const std::vector<WeightedImage>& images,
                                      int dims, const RunContext& context) {
  const BtfelTable& table = material.btfels;
  TESSERA_ASSIGN_OR_RETURN(const std::unique_ptr<Decoder> decoder, MakeDecoder(table));
  if (material.width < 1 || material.height < 1 ||
      table.codes.size() != static_cast<size_t>(material.width) * material.height *
                                static_cast<size_t>(decoder->num_coefficients())) {
    return absl::InvalidArgumentError(absl::StrCat(table.codes.size(), " codes, expected ", material.height,
                                                   " x ", material.width, " x ",
                                                   decoder->num_coefficients()));
  }
  return EmbedFeatures(material.width, material.height, DecodedFeatures(table, *decoder, images), dims,
                       context);
}

absl::StatusOr<Embedding> EmbedDecoded(const Material& material, int dims, const RunContext& context) {
  const std::vector<Node> nodes = MakeNodes();
  std::vector<WeightedImage> images;
  for (const Node& light : nodes) {
    for (size_t view = 0; view < nodes.size(); view += kQuarterTurns) {
      images.push_back({light.direction, nodes[view].direction,
                        std::sqrt(light.weight * nodes[view].weight / 3.0)});  // the mean over channels
    }
  }
  return EmbedImages(material, images, dims, context);
}

}  // namespace tessera
