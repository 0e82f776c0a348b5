#include "btf/tiles/features.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <Eigen/Core>

#include "btf/base/status_macros.h"
#include "btf/codec/recolour.h"
#include "btf/math/conventions.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

absl::Status AtPath(const std::string& path, const absl::Status& status) {
  return absl::Status(status.code(), absl::StrCat(path, ": ", status.message()));
}

Window BoxOf(const std::vector<uint8_t>& mask, int width) {
  int left = width;
  int right = -1;
  int top = -1;
  int bottom = -1;
  for (size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] != 0) {
      const int x = static_cast<int>(i) % width;
      const int y = static_cast<int>(i) / width;
      left = std::min(left, x);
      right = std::max(right, x);
      top = top < 0 ? y : top;
      bottom = y;
    }
  }
  return {left, top, right - left + 1, bottom - top + 1};
}

// The feature turned, its box's top left texel at the origin.
PlacedFeature TurnedFeature(const Exemplar& exemplar, const Feature& feature, int turn) {
  PlacedFeature texels;
  int left = 0;
  int top = 0;
  for (size_t pixel = 0; pixel < feature.mask.size(); ++pixel) {
    if (feature.mask[pixel] != 0) {
      const uint32_t texel = PackTexel(static_cast<uint32_t>(pixel), turn);
      const auto [u, v] = exemplar.TurnedPosition(texel);
      left = texels.empty() ? u : std::min(left, u);
      top = texels.empty() ? v : std::min(top, v);
      texels.push_back({u, v, texel});
    }
  }
  for (PlacedTexel& placed : texels) {
    placed.x -= left;
    placed.y -= top;
  }
  return texels;
}

// Where a feature may lie, and what messages call it.
struct Room {
  Window window;
  std::string what;
};

absl::Status CheckFits(const std::string& path, const Feature& feature, const PlacedFeature& placed,
                       const Room& room) {
  int right = 0;
  int bottom = 0;
  int left = placed.front().x;
  int top = placed.front().y;
  for (const PlacedTexel& at : placed) {
    left = std::min(left, at.x);
    top = std::min(top, at.y);
    right = std::max(right, at.x);
    bottom = std::max(bottom, at.y);
  }
  const Window& w = room.window;
  if (left < w.x || top < w.y || right >= w.x + w.width || bottom >= w.y + w.height) {
    return absl::InvalidArgumentError(
        absl::StrFormat("%s.position: feature \"%s\" would cover columns %d to %d, rows %d to %d; %s columns "
                        "%d to %d, rows %d to %d",
                        path, feature.name, left, right, top, bottom, room.what, w.x, w.x + w.width - 1, w.y,
                        w.y + w.height - 1));
  }
  return absl::OkStatus();
}

// Which placement each texel of a canvas belongs to, so that none takes another's.
class Occupancy {
 public:
  explicit Occupancy(int width) : width_(width) {}

  absl::Status Take(const PlacedFeature& placed, size_t placement, const std::string& where) {
    int num_shared = 0;
    size_t other = 0;
    for (const PlacedTexel& at : placed) {
      const auto [found, is_free] = owner_.try_emplace(at.y * width_ + at.x, placement);
      if (!is_free) {
        ++num_shared;
        other = found->second;
      }
    }
    if (num_shared > 0) {
      return absl::InvalidArgumentError(absl::StrFormat("%s.position: %d texels of %s are taken by %s",
                                                        RecipePath("placements", placement), num_shared,
                                                        where, RecipePath("placements", other)));
    }
    return absl::OkStatus();
  }

 private:
  int width_;
  std::map<int, size_t> owner_;
};

// The texels of a strip that side `side` of a tile shows, on the tile.
PlacedFeature ShownOnSide(const PlacedFeature& on_strip, int side, Sign sign, int tile_size,
                          int strip_height) {
  const int half = strip_height / 2;
  PlacedFeature shown;
  for (const PlacedTexel& at : on_strip) {
    const bool is_plus = sign == Sign::kPlus;
    const int depth = is_plus ? half - 1 - at.y : at.y - half;
    if (depth < 0) {
      continue;  // the other half
    }
    const int along = is_plus ? at.x : tile_size - 1 - at.x;
    const auto [x, y] = TilePixelAt(side, along, depth, tile_size);
    const int turns = StripTexelAt(side, sign, along, depth, tile_size, strip_height).turns;
    shown.push_back({x, y, TurnTexel(at.texel, turns)});
  }
  return shown;
}

absl::StatusOr<Patch> SampleAt(const RecipeCorner& corner, const std::string& path, bool is_upright,
                               const Exemplar& exemplar, int strip_height) {
  const int turn = is_upright ? 3 : corner.turn;  // strips that stand upright are stored lying down
  const bool lies = (turn & 1) != 0;
  const int width = lies ? strip_height : strip_height / 2;
  const int height = lies ? strip_height / 2 : strip_height;
  const auto [x, y] = corner.position;
  if (x + width > exemplar.width() || y + height > exemplar.height()) {
    return absl::InvalidArgumentError(absl::StrFormat(
        "%s.position: the sample, %dx%d texels at [%d, %d], is not inside the exemplar, %dx%d", path, width,
        height, x, y, exemplar.width(), exemplar.height()));
  }
  // Of two opposite texels of the sample, the least column and row in the turned exemplar.
  const auto position = [&](int px, int py) {
    return exemplar.TurnedPosition(PackTexel(static_cast<uint32_t>(py * exemplar.width() + px), turn));
  };
  const auto first = position(x, y);
  const auto last = position(x + width - 1, y + height - 1);
  return Patch{turn, std::min(first[0], last[0]), std::min(first[1], last[1])};
}

absl::Status AddCorners(const Recipe& recipe, const std::vector<Feature>& features, const Exemplar& exemplar,
                        const Arrangement& arrangement, int strip_height, Controls& controls) {
  if (!recipe.corners.empty()) {
    controls.corners.resize(static_cast<size_t>(2) * NumStrips(arrangement));
  }
  for (size_t i = 0; i < recipe.corners.size(); ++i) {
    const RecipeCorner& corner = recipe.corners[i];
    const std::string path = RecipePath("corners", i);
    const bool is_upright = corner.strip.orientation == StripOrientation::kVertical;
    TESSERA_ASSIGN_OR_RETURN(const Patch sample, SampleAt(corner, path, is_upright, exemplar, strip_height));
    for (const Feature& feature : features) {
      int num_inside = 0;
      for (int y = 0; y < strip_height && feature.only_placed; ++y) {
        for (int x = 0; x < strip_height / 2; ++x) {
          num_inside += feature.mask[BtfelOfTexel(exemplar.TexelAt(sample.turn, sample.u + x, sample.v + y))];
        }
      }
      if (num_inside > 0) {
        return absl::InvalidArgumentError(
            absl::StrFormat("%s.position: the sample holds %d texels of feature \"%s\", which is only_placed",
                            path, num_inside, feature.name));
      }
    }
    controls.corners[2 * StripIndex(corner.strip, arrangement) + (corner.is_start ? 0 : 1)] = sample;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<Feature>> ExtractFeatures(const Embedding& embedding, const Recipe& recipe) {
  std::vector<Feature> features;
  for (size_t i = 0; i < recipe.features.size(); ++i) {
    const RecipeFeature& wanted = recipe.features[i];
    absl::StatusOr<std::vector<uint8_t>> mask = SegmentFeature(embedding, wanted.guide);
    if (!mask.ok()) {
      return AtPath(absl::StrFormat("%s (\"%s\")", RecipePath("features", i), wanted.name), mask.status());
    }
    Feature feature{.name = wanted.name, .mask = *std::move(mask), .only_placed = wanted.only_placed};
    feature.box = BoxOf(feature.mask, embedding.width);
    feature.num_texels = static_cast<int>(std::count(feature.mask.begin(), feature.mask.end(), 1));
    features.push_back(std::move(feature));
  }
  return features;
}

absl::Status MoveColours(const Recipe& recipe, const std::vector<Feature>& features, Material& material) {
  if (recipe.colours.empty()) {
    return absl::OkStatus();
  }
  std::vector<Eigen::Matrix3d> maps;
  std::vector<uint8_t> map_of_texel(material.btfels.size(), 0);
  for (size_t i = 0; i < recipe.colours.size(); ++i) {
    const RecipeColour& colour = recipe.colours[i];
    maps.push_back(HueSaturationMap(RadFromDeg(colour.hue_deg), colour.saturation));
    for (size_t texel = 0; texel < map_of_texel.size(); ++texel) {
      const bool in_feature = colour.feature >= 0 && features[colour.feature].mask[texel] != 0;
      const bool in_background =
          colour.feature < 0 && std::none_of(features.begin(), features.end(), [&](const Feature& feature) {
            return feature.mask[texel] != 0;
          });
      if (!in_feature && !in_background) {
        continue;
      }
      if (map_of_texel[texel] != 0) {
        const RecipeColour& other = recipe.colours[map_of_texel[texel] - 1];
        return absl::InvalidArgumentError(absl::StrFormat(
            "%s.of: texel (%d, %d) belongs to both \"%s\" and \"%s\"", RecipePath("colours", i),
            static_cast<int>(texel) % material.width, static_cast<int>(texel) / material.width,
            features[other.feature].name, features[colour.feature].name));
      }
      map_of_texel[texel] = static_cast<uint8_t>(i + 1);
    }
  }
  const absl::Status moved = RecolourTexels(maps, map_of_texel, material);
  return moved.ok() ? moved : AtPath("colours", moved);
}

absl::StatusOr<std::optional<Material>> RecolouredAs(const nlohmann::json& metadata, const Material& material,
                                                     const RunContext& context) {
  const auto recorded = metadata.find(kRecipeKey);
  if (recorded == metadata.end()) {
    return std::nullopt;
  }
  TESSERA_ASSIGN_OR_RETURN(const Recipe recipe, ParseRecipe(recorded->dump()));
  if (recipe.colours.empty()) {
    return std::nullopt;
  }
  const Codec* const codec = FindCodec(material.btfels.codec_id);
  if (codec == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat("unknown codec '", material.btfels.codec_id, "'"));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec->Embed(material, kCutDims, context));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Feature> features, ExtractFeatures(embedding, recipe));
  Material recoloured = material;
  TESSERA_RETURN_IF_ERROR(MoveColours(recipe, features, recoloured));
  return recoloured;
}

absl::StatusOr<Controls> MakeControls(const Recipe& recipe, const std::vector<Feature>& features,
                                      const Exemplar& exemplar, const Arrangement& arrangement, int tile_size,
                                      int strip_height) {
  TESSERA_RETURN_IF_ERROR(CheckRecipe(recipe, arrangement, tile_size, strip_height));
  Controls controls;
  for (const Feature& feature : features) {
    if (feature.only_placed) {
      controls.excluded.resize(feature.mask.size(), 0);
      std::transform(feature.mask.begin(), feature.mask.end(), controls.excluded.begin(),
                     controls.excluded.begin(), [](uint8_t a, uint8_t b) { return a | b; });
    }
  }
  TESSERA_RETURN_IF_ERROR(AddCorners(recipe, features, exemplar, arrangement, strip_height, controls));
  if (recipe.placements.empty()) {
    return controls;
  }

  const int num_tiles = static_cast<int>(arrangement.codes.size());
  const int half = strip_height / 2;
  controls.strips.resize(NumStrips(arrangement));
  controls.tiles.resize(num_tiles);
  std::vector<Occupancy> strip_owners(controls.strips.size(), Occupancy(tile_size));
  std::vector<Occupancy> tile_owners(num_tiles, Occupancy(tile_size));
  const auto take_on_tile = [&](int tile, PlacedFeature placed, size_t placement) -> absl::Status {
    TESSERA_RETURN_IF_ERROR(
        tile_owners[tile].Take(placed, placement, absl::StrFormat("tile %d", arrangement.codes[tile])));
    controls.tiles[tile].push_back(std::move(placed));
    return absl::OkStatus();
  };
  for (size_t i = 0; i < recipe.placements.size(); ++i) {
    const RecipePlacement& placement = recipe.placements[i];
    const Feature& feature = features[placement.feature];
    const std::string path = RecipePath("placements", i);
    PlacedFeature placed = TurnedFeature(exemplar, feature, placement.turn);
    for (PlacedTexel& at : placed) {
      at.x += placement.position[0];
      at.y += placement.position[1];
    }
    if (!placement.strip) {
      TESSERA_RETURN_IF_ERROR(CheckFits(
          path, feature, placed, {{1, 1, tile_size - 2, tile_size - 2}, "the inside of the tile has"}));
      const auto tile =
          std::lower_bound(arrangement.codes.begin(), arrangement.codes.end(), *placement.tile) -
          arrangement.codes.begin();
      TESSERA_RETURN_IF_ERROR(take_on_tile(static_cast<int>(tile), std::move(placed), i));
      continue;
    }
    const bool is_upright = placement.strip->orientation == StripOrientation::kVertical;
    const int gap = tile_size - strip_height;
    TESSERA_RETURN_IF_ERROR(
        CheckFits(path, feature, placed,
                  {is_upright ? Window{0, half, strip_height, gap} : Window{half, 0, gap, strip_height},
                   "between its corner samples the strip has"}));
    for (PlacedTexel& at : placed) {
      if (is_upright) {
        at = {tile_size - 1 - at.y, at.x, TurnTexel(at.texel, 3)};
      }
    }
    const int strip = StripIndex(*placement.strip, arrangement);
    TESSERA_RETURN_IF_ERROR(strip_owners[strip].Take(placed, i, "the strip"));
    for (int tile = 0; tile < num_tiles; ++tile) {
      const TileSides sides = arrangement.SidesOf(tile);
      for (int side = 0; side < 4; ++side) {
        if (StripOfSide(arrangement, side, sides[side].colour) == strip) {
          PlacedFeature shown = ShownOnSide(placed, side, sides[side].sign, tile_size, strip_height);
          if (!shown.empty()) {
            TESSERA_RETURN_IF_ERROR(take_on_tile(tile, std::move(shown), i));
          }
        }
      }
    }
    controls.strips[strip].push_back(std::move(placed));
  }
  return controls;
}

}  // namespace tessera
