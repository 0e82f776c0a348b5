// Recipes: what a person wants of a tile set, as a JSON file [Leung2007] 3.3. RECIPE.md describes it.
//
//   TESSERA_ASSIGN_OR_RETURN(Recipe recipe, ParseRecipe(text));
//   TESSERA_RETURN_IF_ERROR(CheckRecipe(recipe, arrangement, params.tile_size, params.strip_height));
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <absl/status/status.h>
#include <absl/status/statusor.h>
#include <nlohmann/json.hpp>

#include "btf/tiles/segmentation.h"
#include "btf/wang/arrangement.h"

namespace tessera {

// What a recipe may hold at most.
inline constexpr size_t kMaxRecipeBytes = size_t{1} << 20;
inline constexpr size_t kMaxRecipeFeatures = 32;
inline constexpr size_t kMaxRecipePlacements = 1024;
inline constexpr size_t kMaxStrokePoints = 4096;  // of one feature's strokes

// Key of a tile set's metadata that holds its recipe.
inline constexpr char kRecipeKey[] = "recipe";

// The name of all texels that belong to no feature.
inline constexpr std::string_view kBackgroundName = "background";

struct RecipeFeature {
  std::string name;  // [a-z0-9-]{1,63}
  SegmentationGuide guide;
  bool only_placed = false;  // synthesis brings its texels nowhere else
};

enum class StripOrientation { kEither, kHorizontal, kVertical };

// A strip: kEither in surface-*, where one pool serves all sides.
struct RecipeStrip {
  StripOrientation orientation = StripOrientation::kEither;
  int colour = 0;
};

// The feature's bounding box, turned, with its top left texel at `position` of the strip or tile.
struct RecipePlacement {
  int feature = 0;                   // index
  std::optional<RecipeStrip> strip;  // either this
  std::optional<uint32_t> tile;      // or the code of a tile
  std::array<int, 2> position{};
  int turn = 0;
};

struct RecipeCorner {
  RecipeStrip strip;
  bool is_start = true;
  std::array<int, 2> position{};  // top left texel of the sample in the unturned exemplar
  int turn = 0;
};

struct RecipeColour {
  int feature = -1;  // index, -1 for the background
  double hue_deg = 0.0;
  double saturation = 1.0;
};

struct Recipe {
  std::vector<RecipeFeature> features;
  std::vector<RecipePlacement> placements;
  std::vector<RecipeCorner> corners;
  std::vector<RecipeColour> colours;
  // As it was parsed: its dump() is the same for recipes that differ in white space and order of keys alone.
  nlohmann::json json = nlohmann::json::object();
};

// Strict: a key that is not known is refused. Errors: INVALID_ARGUMENT that starts with the path of the key,
// as in "placements[2].position: ..". Safe on hostile text.
[[nodiscard]] absl::StatusOr<Recipe> ParseRecipe(std::string_view text);

// What can be refused without a material: strips, tiles and turns that the arrangement does not have, and
// positions off their strip or tile. Errors: as above.
[[nodiscard]] absl::Status CheckRecipe(const Recipe& recipe, const Arrangement& arrangement, int tile_size,
                                       int strip_height);

// Number of the strip (tile_sides.h); of one that CheckRecipe lets pass.
[[nodiscard]] int StripIndex(const RecipeStrip& strip, const Arrangement& arrangement);

// Paths of keys for messages: "placements[2]".
[[nodiscard]] std::string RecipePath(std::string_view list, size_t index);

}  // namespace tessera
