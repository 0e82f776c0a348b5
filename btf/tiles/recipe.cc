#include "btf/tiles/recipe.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <span>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "btf/base/status_macros.h"
#include "btf/tiles/tile_sides.h"

namespace tessera {
namespace {

using Json = nlohmann::json;

constexpr int kMostCoordinate = 1 << 20;
constexpr double kMostHueDeg = 360.0;
constexpr double kMostSaturation = 4.0;
constexpr size_t kMostNameLength = 63;

absl::Status Refusal(std::string_view path, std::string_view message) {
  return absl::InvalidArgumentError(absl::StrCat(std::string(path), ": ", std::string(message)));
}

std::string KeyPath(std::string_view path, const char* key) {
  return path.empty() ? std::string(key) : absl::StrCat(std::string(path), ".", key);
}

absl::Status CheckKeys(const Json& object, std::string_view path, std::initializer_list<const char*> required,
                       std::initializer_list<const char*> optional) {
  if (!object.is_object()) {
    return Refusal(path.empty() ? "recipe" : path, "not an object");
  }
  for (const char* const key : required) {
    if (!object.contains(key)) {
      return Refusal(KeyPath(path, key), "missing");
    }
  }
  std::vector<std::string> known(required.begin(), required.end());
  known.insert(known.end(), optional.begin(), optional.end());
  for (const auto& item : object.items()) {
    if (std::find(known.begin(), known.end(), item.key()) == known.end()) {
      return Refusal(KeyPath(path, item.key().c_str()),
                     absl::StrCat("unknown key, known: ", absl::StrJoin(known, ", ")));
    }
  }
  return absl::OkStatus();
}

// The array at a key that may be absent.
absl::StatusOr<std::span<const Json>> ReadArray(const Json& object, std::string_view path, const char* key,
                                                size_t most) {
  const auto found = object.find(key);
  if (found == object.end()) {
    return std::span<const Json>();
  }
  if (!found->is_array() || found->size() > most) {
    return Refusal(KeyPath(path, key), absl::StrCat("expected an array of at most ", most));
  }
  return std::span<const Json>(found->get_ref<const Json::array_t&>());
}

absl::StatusOr<int> ReadWhole(const Json& value, std::string_view path, int least, int most) {
  if (!value.is_number_integer() || value < least || value > most) {
    return Refusal(path, absl::StrFormat("%s, expected a whole number in [%d, %d]",
                                         value.is_number() ? value.dump() : "not a number", least, most));
  }
  return value.get<int>();
}

absl::StatusOr<double> ReadReal(const Json& value, std::string_view path, double least, double most) {
  if (!value.is_number() || !(value.get<double>() >= least && value.get<double>() <= most)) {
    return Refusal(path, absl::StrFormat("%s, expected a number in [%g, %g]",
                                         value.is_number() ? value.dump() : "not a number", least, most));
  }
  return value.get<double>();
}

absl::StatusOr<std::array<int, 2>> ReadPoint(const Json& value, std::string_view path) {
  if (!value.is_array() || value.size() != 2) {
    return Refusal(path, "expected [x, y]");
  }
  std::array<int, 2> point{};
  for (size_t i = 0; i < 2; ++i) {
    TESSERA_ASSIGN_OR_RETURN(point[i], ReadWhole(value[i], RecipePath(path, i), 0, kMostCoordinate));
  }
  return point;
}

absl::StatusOr<int> ReadTurn(const Json& object, std::string_view path) {
  return object.contains("turn") ? ReadWhole(object["turn"], KeyPath(path, "turn"), 0, 3) : 0;
}

absl::StatusOr<std::vector<Stroke>> ReadStrokes(const Json& object, std::string_view path, const char* key) {
  TESSERA_ASSIGN_OR_RETURN(const std::span<const Json> list, ReadArray(object, path, key, kMaxStrokePoints));
  const std::string list_path = KeyPath(path, key);
  std::vector<Stroke> strokes;
  size_t num_points = 0;
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string stroke_path = RecipePath(list_path, i);
    const Json& points = list[i];
    num_points += points.size();
    if (!points.is_array() || points.empty() || num_points > kMaxStrokePoints) {
      return Refusal(stroke_path, absl::StrCat("expected an array of points [x, y], at most ",
                                               kMaxStrokePoints, " in all"));
    }
    Stroke stroke;
    for (size_t j = 0; j < points.size(); ++j) {
      TESSERA_ASSIGN_OR_RETURN(stroke.emplace_back(), ReadPoint(points[j], RecipePath(stroke_path, j)));
    }
    strokes.push_back(std::move(stroke));
  }
  return strokes;
}

absl::StatusOr<std::string> ReadName(const Json& value, std::string_view path) {
  const auto allowed = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-'; };
  const std::string name = value.is_string() ? value.get<std::string>() : "";
  if (name.empty() || name.size() > kMostNameLength || !std::all_of(name.begin(), name.end(), allowed)) {
    return Refusal(path, absl::StrCat("expected a name of 1 to ", kMostNameLength, " of a-z, 0-9 and -"));
  }
  return name;
}

absl::Status ReadFeature(const Json& entry, const std::string& path, Recipe& recipe) {
  TESSERA_RETURN_IF_ERROR(CheckKeys(entry, path, {"name"}, {"seeds", "rectangle", "only_placed"}));
  RecipeFeature feature;
  TESSERA_ASSIGN_OR_RETURN(feature.name, ReadName(entry["name"], KeyPath(path, "name")));
  const bool is_taken = std::any_of(recipe.features.begin(), recipe.features.end(),
                                    [&](const RecipeFeature& other) { return other.name == feature.name; });
  if (is_taken || feature.name == kBackgroundName) {
    return Refusal(KeyPath(path, "name"), absl::StrCat("\"", feature.name, "\" is taken"));
  }
  if (entry.contains("seeds")) {
    const std::string seeds_path = KeyPath(path, "seeds");
    TESSERA_RETURN_IF_ERROR(CheckKeys(entry["seeds"], seeds_path, {}, {"feature", "background"}));
    TESSERA_ASSIGN_OR_RETURN(feature.guide.feature, ReadStrokes(entry["seeds"], seeds_path, "feature"));
    TESSERA_ASSIGN_OR_RETURN(feature.guide.background, ReadStrokes(entry["seeds"], seeds_path, "background"));
  }
  if (entry.contains("rectangle")) {
    const Json& value = entry["rectangle"];
    const std::string rectangle_path = KeyPath(path, "rectangle");
    if (!value.is_array() || value.size() != 4) {
      return Refusal(rectangle_path, "expected [x, y, width, height]");
    }
    std::array<int, 4> numbers{};
    for (size_t i = 0; i < 4; ++i) {
      TESSERA_ASSIGN_OR_RETURN(
          numbers[i], ReadWhole(value[i], RecipePath(rectangle_path, i), i < 2 ? 0 : 1, kMostCoordinate));
    }
    feature.guide.rectangle = Window{numbers[0], numbers[1], numbers[2], numbers[3]};
  }
  if (feature.guide.feature.empty() && !feature.guide.rectangle) {
    return Refusal(path, "needs a rectangle or seeds.feature");
  }
  if (entry.contains("only_placed")) {
    if (!entry["only_placed"].is_boolean()) {
      return Refusal(KeyPath(path, "only_placed"), "expected true or false");
    }
    feature.only_placed = entry["only_placed"].get<bool>();
  }
  recipe.features.push_back(std::move(feature));
  return absl::OkStatus();
}

// The feature of this name, -1 for the background.
absl::StatusOr<int> ReadFeatureName(const Json& value, const std::string& path, const Recipe& recipe) {
  TESSERA_ASSIGN_OR_RETURN(const std::string name, ReadName(value, path));
  if (name == kBackgroundName) {
    return -1;
  }
  for (size_t i = 0; i < recipe.features.size(); ++i) {
    if (recipe.features[i].name == name) {
      return static_cast<int>(i);
    }
  }
  return Refusal(path, absl::StrCat("no feature is named \"", name, "\""));
}

absl::StatusOr<RecipeStrip> ReadStrip(const Json& value, const std::string& path) {
  TESSERA_RETURN_IF_ERROR(CheckKeys(value, path, {"colour"}, {"orientation"}));
  RecipeStrip strip;
  TESSERA_ASSIGN_OR_RETURN(strip.colour,
                           ReadWhole(value["colour"], KeyPath(path, "colour"), 0, kMostColours - 1));
  if (value.contains("orientation")) {
    if (value["orientation"] == "horizontal") {
      strip.orientation = StripOrientation::kHorizontal;
    } else if (value["orientation"] == "vertical") {
      strip.orientation = StripOrientation::kVertical;
    } else {
      return Refusal(KeyPath(path, "orientation"), "expected \"horizontal\" or \"vertical\"");
    }
  }
  return strip;
}

absl::Status ReadPlacement(const Json& entry, const std::string& path, Recipe& recipe) {
  TESSERA_RETURN_IF_ERROR(CheckKeys(entry, path, {"feature", "position"}, {"strip", "tile", "turn"}));
  RecipePlacement placement;
  TESSERA_ASSIGN_OR_RETURN(placement.feature,
                           ReadFeatureName(entry["feature"], KeyPath(path, "feature"), recipe));
  if (placement.feature < 0) {
    return Refusal(KeyPath(path, "feature"), "the background cannot be placed");
  }
  if (entry.contains("strip") == entry.contains("tile")) {
    return Refusal(path, "needs one of strip and tile");
  }
  if (entry.contains("strip")) {
    TESSERA_ASSIGN_OR_RETURN(placement.strip, ReadStrip(entry["strip"], KeyPath(path, "strip")));
  } else {
    TESSERA_ASSIGN_OR_RETURN(placement.tile,
                             ReadWhole(entry["tile"], KeyPath(path, "tile"), 0, kMostCoordinate));
  }
  TESSERA_ASSIGN_OR_RETURN(placement.position, ReadPoint(entry["position"], KeyPath(path, "position")));
  TESSERA_ASSIGN_OR_RETURN(placement.turn, ReadTurn(entry, path));
  recipe.placements.push_back(placement);
  return absl::OkStatus();
}

absl::Status ReadCorner(const Json& entry, const std::string& path, Recipe& recipe) {
  TESSERA_RETURN_IF_ERROR(CheckKeys(entry, path, {"strip", "end", "position"}, {"turn"}));
  RecipeCorner corner;
  TESSERA_ASSIGN_OR_RETURN(corner.strip, ReadStrip(entry["strip"], KeyPath(path, "strip")));
  if (entry["end"] != "start" && entry["end"] != "end") {
    return Refusal(KeyPath(path, "end"), "expected \"start\" or \"end\"");
  }
  corner.is_start = entry["end"] == "start";
  TESSERA_ASSIGN_OR_RETURN(corner.position, ReadPoint(entry["position"], KeyPath(path, "position")));
  TESSERA_ASSIGN_OR_RETURN(corner.turn, ReadTurn(entry, path));
  recipe.corners.push_back(corner);
  return absl::OkStatus();
}

absl::Status ReadColour(const Json& entry, const std::string& path, Recipe& recipe) {
  TESSERA_RETURN_IF_ERROR(CheckKeys(entry, path, {"of"}, {"hue_deg", "saturation"}));
  RecipeColour colour;
  TESSERA_ASSIGN_OR_RETURN(colour.feature, ReadFeatureName(entry["of"], KeyPath(path, "of"), recipe));
  for (const RecipeColour& other : recipe.colours) {
    if (other.feature == colour.feature) {
      return Refusal(KeyPath(path, "of"), "its colour is moved before");
    }
  }
  if (entry.contains("hue_deg")) {
    TESSERA_ASSIGN_OR_RETURN(colour.hue_deg,
                             ReadReal(entry["hue_deg"], KeyPath(path, "hue_deg"), -kMostHueDeg, kMostHueDeg));
  }
  if (entry.contains("saturation")) {
    TESSERA_ASSIGN_OR_RETURN(
        colour.saturation, ReadReal(entry["saturation"], KeyPath(path, "saturation"), 0.0, kMostSaturation));
  }
  recipe.colours.push_back(colour);
  return absl::OkStatus();
}

using EntryReader = absl::Status (*)(const Json& entry, const std::string& path, Recipe& recipe);

absl::Status ReadEntries(const char* key, size_t most, EntryReader reader, Recipe& recipe) {
  TESSERA_ASSIGN_OR_RETURN(const std::span<const Json> list, ReadArray(recipe.json, "", key, most));
  for (size_t i = 0; i < list.size(); ++i) {
    TESSERA_RETURN_IF_ERROR(reader(list[i], RecipePath(key, i), recipe));
  }
  return absl::OkStatus();
}

absl::Status CheckStrip(const RecipeStrip& strip, const std::string& path, const Arrangement& arrangement) {
  if (arrangement.turned_strips && strip.orientation != StripOrientation::kEither) {
    return Refusal(KeyPath(path, "orientation"),
                   absl::StrCat("the strips of ", arrangement.id, " have none: one pool serves all sides"));
  }
  if (!arrangement.turned_strips && strip.orientation == StripOrientation::kEither) {
    return Refusal(KeyPath(path, "orientation"),
                   absl::StrCat("missing: the strips of ", arrangement.id, " are horizontal or vertical"));
  }
  if (strip.colour >= arrangement.num_colours) {
    return Refusal(KeyPath(path, "colour"),
                   absl::StrFormat("%d, but %s has the colours 0 to %d", strip.colour, arrangement.id,
                                   arrangement.num_colours - 1));
  }
  return absl::OkStatus();
}

absl::Status CheckTurn(int turn, const std::string& path, const Arrangement& arrangement) {
  if (turn != 0 && !arrangement.turned_strips) {
    return Refusal(KeyPath(path, "turn"),
                   absl::StrFormat("%d: nothing is turned in %s", turn, arrangement.id));
  }
  return absl::OkStatus();
}

}  // namespace

std::string RecipePath(std::string_view list, size_t index) {
  return absl::StrCat(std::string(list), "[", index, "]");
}

int StripIndex(const RecipeStrip& strip, const Arrangement& arrangement) {
  const int side = strip.orientation == StripOrientation::kVertical ? 1 : 0;
  return StripOfSide(arrangement, side, strip.colour);
}

absl::StatusOr<Recipe> ParseRecipe(std::string_view text) {
  if (text.size() > kMaxRecipeBytes) {
    return absl::InvalidArgumentError(
        absl::StrCat("recipe: ", text.size(), " bytes, at most ", kMaxRecipeBytes));
  }
  Recipe recipe;
  recipe.json = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (recipe.json.is_discarded()) {
    return absl::InvalidArgumentError("recipe: not JSON");
  }
  TESSERA_RETURN_IF_ERROR(CheckKeys(recipe.json, "", {}, {"features", "placements", "corners", "colours"}));
  TESSERA_RETURN_IF_ERROR(ReadEntries("features", kMaxRecipeFeatures, ReadFeature, recipe));
  TESSERA_RETURN_IF_ERROR(ReadEntries("placements", kMaxRecipePlacements, ReadPlacement, recipe));
  TESSERA_RETURN_IF_ERROR(ReadEntries("corners", kMaxRecipePlacements, ReadCorner, recipe));
  TESSERA_RETURN_IF_ERROR(ReadEntries("colours", kMaxRecipeFeatures + 1, ReadColour, recipe));
  return recipe;
}

absl::Status CheckRecipe(const Recipe& recipe, const Arrangement& arrangement, int tile_size,
                         int strip_height) {
  for (size_t i = 0; i < recipe.placements.size(); ++i) {
    const RecipePlacement& placement = recipe.placements[i];
    const std::string path = RecipePath("placements", i);
    int width = tile_size;
    int height = tile_size;
    if (placement.strip) {
      TESSERA_RETURN_IF_ERROR(CheckStrip(*placement.strip, KeyPath(path, "strip"), arrangement));
      const bool upright = placement.strip->orientation == StripOrientation::kVertical;
      (upright ? width : height) = strip_height;
    } else if (!std::binary_search(arrangement.codes.begin(), arrangement.codes.end(), *placement.tile)) {
      return Refusal(KeyPath(path, "tile"),
                     absl::StrFormat("%d is not the code of a tile of %s", *placement.tile, arrangement.id));
    }
    TESSERA_RETURN_IF_ERROR(CheckTurn(placement.turn, path, arrangement));
    if (placement.position[0] >= width || placement.position[1] >= height) {
      return Refusal(
          KeyPath(path, "position"),
          absl::StrFormat("[%d, %d] is off the %s, %dx%d texels", placement.position[0],
                          placement.position[1], placement.strip ? "strip" : "tile", width, height));
    }
  }
  std::vector<int> samples;
  for (size_t i = 0; i < recipe.corners.size(); ++i) {
    const RecipeCorner& corner = recipe.corners[i];
    const std::string path = RecipePath("corners", i);
    TESSERA_RETURN_IF_ERROR(CheckStrip(corner.strip, KeyPath(path, "strip"), arrangement));
    TESSERA_RETURN_IF_ERROR(CheckTurn(corner.turn, path, arrangement));
    const int sample = 2 * StripIndex(corner.strip, arrangement) + (corner.is_start ? 0 : 1);
    if (std::find(samples.begin(), samples.end(), sample) != samples.end()) {
      return Refusal(path, "this end of this strip is given before");
    }
    samples.push_back(sample);
  }
  return absl::OkStatus();
}

}  // namespace tessera
