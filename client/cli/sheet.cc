// tessera sheet
#include <memory>

#include "btf/base/atomic_file.h"
#include "btf/base/status_macros.h"
#include "btf/image/image_io.h"
#include "client/cli/arguments.h"
#include "client/cli/commands.h"
#include "client/cli/contact_sheet.h"

namespace tessera::cli {
namespace {

struct SheetFlags {
  std::vector<std::string> pictures;
  std::vector<std::string> captions;
  int columns = 0;
  std::string output;
};

absl::Status RunSheet(Session& session, const SheetFlags& flags) {
  TESSERA_ASSIGN_OR_RETURN(const PictureFormat format, PictureFormatOf(flags.output));
  std::vector<Image> pictures;
  for (const std::string& path : flags.pictures) {
    TESSERA_ASSIGN_OR_RETURN(pictures.emplace_back(), ReadImage(path, std::nullopt));
  }
  TESSERA_ASSIGN_OR_RETURN(const Image sheet, ContactSheet(pictures, flags.columns, flags.captions));
  TESSERA_ASSIGN_OR_RETURN(const std::string bytes,
                           format == PictureFormat::kPng ? EncodePng(sheet) : EncodeExr(sheet));
  TESSERA_RETURN_IF_ERROR(WriteFileAtomically(flags.output, bytes));
  session.Answer({{"file", flags.output}, {"width", sheet.width}, {"height", sheet.height}}, flags.output);
  return absl::OkStatus();
}

}  // namespace

void AddSheetCommand(CLI::App& app, Session& session) {
  const auto flags = std::make_shared<SheetFlags>();
  CLI::App* command = app.add_subcommand("sheet", "Pictures side by side in one; needs no server");
  command->add_option("PICTURE", flags->pictures, "PNG, JPEG or EXR files")->required();
  command->add_option("--columns", flags->columns, "Pictures a row [about square]")
      ->check(CLI::NonNegativeNumber);
  command->add_option("--caption", flags->captions, "Below a picture; one for each, in their order")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  command->add_option("-o,--output", flags->output, "File to write, .png (sRGB) or .exr (linear)")
      ->required();
  command->callback(
      [&session, flags] { session.run = [&session, flags] { return RunSheet(session, *flags); }; });
}

}  // namespace tessera::cli
