#include "client/cli/mask.h"

#include <array>
#include <memory>

#include <fmt/format.h>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/codec/codec.h"
#include "btf/image/image_io.h"
#include "btf/tiles/features.h"
#include "client/cli/arguments.h"
#include "client/cli/contact_sheet.h"
#include "client/lib/client.h"
#include "client/lib/flat_decode.h"
#include "client/lib/names.h"

namespace tessera::cli {
namespace {

struct MaskFlags {
  std::string material;
  std::string recipe;
  std::string light = "30,135";
  std::string view = "0,0";
  std::string output;
};

absl::Status RunMask(Session& session, const MaskFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const std::string full_name, FullMaterialName(flags.material));
  TESSERA_ASSIGN_OR_RETURN(const Direction light, ParseDirection(flags.light));
  TESSERA_ASSIGN_OR_RETURN(const Direction view, ParseDirection(flags.view));
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  TESSERA_ASSIGN_OR_RETURN(const Recipe recipe, ReadRecipeFile(flags.recipe));
  TESSERA_ASSIGN_OR_RETURN(Client * client, session.Connect());
  const RunContext context = session.Context();
  TESSERA_ASSIGN_OR_RETURN(Material material, client->FetchMaterial(full_name, context));
  const Codec* const codec = FindCodec(material.btfels.codec_id);
  if (codec == nullptr) {
    return absl::UnimplementedError(fmt::format("unknown codec '{}'", material.btfels.codec_id));
  }
  TESSERA_ASSIGN_OR_RETURN(const Embedding embedding, codec->Embed(material, kCutDims, context));
  TESSERA_ASSIGN_OR_RETURN(const std::vector<Feature> features, ExtractFeatures(embedding, recipe));
  TESSERA_ASSIGN_OR_RETURN(const Image before, DecodeFlat(material, light, view, context));
  TESSERA_RETURN_IF_ERROR(MoveColours(recipe, features, material));
  TESSERA_ASSIGN_OR_RETURN(const Image after, DecodeFlat(material, light, view, context));

  std::vector<uint8_t> mask(static_cast<size_t>(material.width) * material.height, 0);
  Json described = Json::array();
  std::string text;
  for (const Feature& feature : features) {
    for (size_t i = 0; i < mask.size(); ++i) {
      mask[i] |= feature.mask[i];
    }
    const Window& box = feature.box;
    described.push_back({{"name", feature.name},
                         {"texels", feature.num_texels},
                         {"box", {box.x, box.y, box.width, box.height}}});
    text += fmt::format("{}: {} texels, {}x{} at ({}, {})\n", feature.name, feature.num_texels, box.width,
                        box.height, box.x, box.y);
  }
  TESSERA_ASSIGN_OR_RETURN(const Image sheet, ContactSheet({Highlighted(before, mask), after}, 2));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           format == PictureFormat::kPng ? EncodePng(sheet) : EncodeExr(sheet));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  session.FinishStages();
  session.Answer({{"file", flags.output},
                  {"width", sheet.width},
                  {"height", sheet.height},
                  {"features", std::move(described)}},
                 text + flags.output);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<Recipe> ReadRecipeFile(const std::string& path) {
  TESSERA_ASSIGN_OR_RETURN(const std::string text, ReadWholeFile(path));
  absl::StatusOr<Recipe> recipe = ParseRecipe(text);
  if (!recipe.ok()) {
    return absl::Status(recipe.status().code(),
                        fmt::format("{}: {}", path, std::string(recipe.status().message())));
  }
  return recipe;
}

Image Highlighted(const Image& picture, const std::vector<uint8_t>& mask) {
  constexpr float kDark = 0.35F;
  constexpr std::array<float, 3> kRed = {0.9F, 0.03F, 0.03F};
  Image highlighted = picture;
  for (size_t texel = 0; texel < mask.size(); ++texel) {
    for (size_t channel = 0; channel < kRed.size(); ++channel) {
      float& value = highlighted.pixels[texel * kRed.size() + channel];
      value = mask[texel] != 0 ? 0.5F * (value + kRed[channel]) : kDark * value;
    }
  }
  return highlighted;
}

void AddMaskCommand(CLI::App& noun, Session& session) {
  const auto flags = std::make_shared<MaskFlags>();
  CLI::App* command =
      noun.add_subcommand("mask", "What a recipe takes for its features, in red, and the colours it moves");
  command->add_option("MATERIAL", flags->material, "Name of the material")->required();
  command->add_option("--recipe", flags->recipe, "JSON file: btf/tiles/RECIPE.md")->required();
  command->add_option("--light", flags->light, "TH,PH in degrees, TH from the normal")->capture_default_str();
  command->add_option("--view", flags->view, "Likewise")->capture_default_str();
  command->add_option("-o,--output", flags->output, "File to write, .png (sRGB) or .exr (linear)")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunMask(session, *flags); }; });
}

}  // namespace tessera::cli
